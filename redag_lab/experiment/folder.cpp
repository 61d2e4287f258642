// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/experiment/folder.hpp"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <filesystem>
#include <iterator>
#include <system_error>
#include <utility>

#include <fmt/chrono.h>
#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "redag/base/provenance.hpp"
#include "redag/base/text.hpp"
#include "redag/trace/output_file.hpp"
#include "redag/trace/trace.hpp"
#include "redag/version.hpp"

namespace redag::experiment {
namespace {

using Json = nlohmann::ordered_json;
using trace::file_error;

std::string plan_file(const std::string &folder) { return folder + "/plan.yaml"; }
std::string units_file(const std::string &folder) { return folder + "/units.csv"; }
std::string runs_file(const std::string &folder) { return folder + "/runs.jsonl"; }

// Identifies the origin of the units: the plan, by its FNV-1a hash, and the version of the code.
std::string subject(const std::string &plan) {
  std::uint64_t hash = 0xcbf29ce484222325ULL;
  for (const char c : plan) hash = (hash ^ static_cast<unsigned char>(c)) * 0x100000001b3ULL;
  return fmt::format("plan {:016x} version {}", hash, kVersion);
}

std::string_view line_of(std::string_view text, int number) {
  for (; number > 1; --number) {
    const std::size_t end = text.find('\n');
    if (end == std::string_view::npos) return {};
    text.remove_prefix(end + 1);
  }
  return text.substr(0, text.find('\n'));
}

Result<void> expect_plan(const std::string &file, const std::string &there, const std::string &plan) {
  if (there == plan) return {};
  const auto first = std::mismatch(there.begin(), there.end(), plan.begin(), plan.end()).first;
  const int line = 1 + static_cast<int>(std::count(there.begin(), first, '\n'));
  return file_error(file, line,
                    fmt::format("the folder holds results of another plan: '{}' there, '{}' now", line_of(there, line),
                                line_of(plan, line)),
                    "choose another folder, or resume with the plan in this one");
}

// Syncs the folder: the names of new files reach the disk with their folder.
void sync_folder(const std::string &folder) {
  const int descriptor = ::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (descriptor < 0) return;
  ::fsync(descriptor);
  ::close(descriptor);
}

Json stamp(const char *event) {
  const auto now = std::chrono::time_point_cast<std::chrono::seconds>(std::chrono::system_clock::now());
  return Json{{"event", event}, {"utc", fmt::format("{:%Y-%m-%dT%H:%M:%SZ}", fmt::gmtime(now))}};
}

}  // namespace

Result<Journal> open_folder(const std::string &folder, const std::string &plan) {
  const std::string file = plan_file(folder);
  if (std::filesystem::exists(file)) {
    const Result<std::string> there = trace::read_file(file);
    if (!there) return tl::unexpected<Diagnostics>(there.error());
    if (Result<void> same = expect_plan(file, *there, plan); !same) {
      return tl::unexpected<Diagnostics>(std::move(same.error()));
    }
  } else {
    Result<trace::OutputFile> output = trace::OutputFile::create(file);
    if (!output) return tl::unexpected<Diagnostics>(std::move(output.error()));
    output->write(plan);
    if (Result<void> written = output->commit(); !written) {
      return tl::unexpected<Diagnostics>(std::move(written.error()));
    }
  }
  Result<Journal> journal = Journal::open(units_file(folder), subject(plan));
  if (journal) sync_folder(folder);
  return journal;
}

Result<std::string> read_plan(const std::string &folder) {
  Result<std::string> plan = trace::read_file(plan_file(folder));
  if (!plan) plan.error().front().hint = "is this the folder of an experiment (--out)?";
  return plan;
}

Result<std::vector<FinishedUnit>> read_folders(const std::vector<std::string> &folders, const std::string &plan) {
  std::vector<FinishedUnit> all;
  for (const std::string &folder : folders) {
    const Result<std::string> there = read_plan(folder);
    if (!there) return tl::unexpected<Diagnostics>(there.error());
    if (Result<void> same = expect_plan(plan_file(folder), *there, plan); !same) {
      return tl::unexpected<Diagnostics>(std::move(same.error()));
    }
    Result<std::vector<FinishedUnit>> units = read_journal(units_file(folder), subject(plan));
    if (!units) return units;
    all.insert(all.end(), std::make_move_iterator(units->begin()), std::make_move_iterator(units->end()));
  }
  if (Result<void> united = sort_and_unite(all, fmt::format("{}", fmt::join(folders, ", "))); !united) {
    return tl::unexpected<Diagnostics>(std::move(united.error()));
  }
  return all;
}

Result<void> log_run(const std::string &folder, const RunBegin &run) {
  const trace::Machine machine = trace::this_machine();
  Json json = stamp("begin");
  json["provenance"] = Json::parse(provenance_to_json(current_provenance()));
  json["version"] = kVersion;
  json["machine"] = {{"cpus", machine.cpus}, {"kernel", machine.kernel}, {"model", machine.model}};
  json["shard"] = to_string(run.shard);
  json["jobs"] = run.jobs;
  json["units"] = run.units;
  return add_runs(folder, {json.dump(-1, ' ', false, Json::error_handler_t::replace)});
}

Result<void> log_run(const std::string &folder, const RunEnd &run) {
  Json json = stamp("end");
  json["units"] = run.units;
  json["elapsed_ns"] = run.elapsed;
  json["interrupted"] = run.interrupted;
  return add_runs(folder, {json.dump()});
}

std::vector<std::string> read_runs(const std::vector<std::string> &folders) {
  std::vector<std::string> lines;
  for (const std::string &folder : folders) {
    const Result<std::string> text = trace::read_file(runs_file(folder));
    if (!text) continue;
    for (std::string_view rest = *text; !rest.empty();) {
      const std::size_t end = rest.find('\n');
      if (end == std::string_view::npos) break;  // the process was killed while it wrote this line
      const std::string_view line = rest.substr(0, end);
      if (!json_nests_deeper(line) && Json::accept(line)) lines.emplace_back(line);
      rest.remove_prefix(end + 1);
    }
  }
  return lines;
}

Result<void> add_runs(const std::string &folder, const std::vector<std::string> &lines) {
  std::string text;
  for (const std::string &line : lines) text += line + "\n";
  const std::string file = runs_file(folder);
  const int descriptor = ::open(file.c_str(), O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0666);
  const ssize_t written = descriptor < 0 ? -1 : ::write(descriptor, text.data(), text.size());
  const int error = errno;
  if (descriptor >= 0) ::close(descriptor);
  if (written == static_cast<ssize_t>(text.size())) return {};
  return file_error(file, 0, fmt::format("cannot write: {}", std::strerror(error)));
}

}  // namespace redag::experiment
