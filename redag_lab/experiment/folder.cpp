// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/experiment/folder.hpp"

#include <fcntl.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <memory>
#include <optional>
#include <queue>
#include <set>
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
std::string units_file(const std::string &folder) { return folder + "/units.db"; }
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

// Returns the job as Slurm's commands name it, such as "17_3" for task 3 of an array; empty elsewhere.
std::string slurm_job() {
  const char *array = std::getenv("SLURM_ARRAY_JOB_ID");
  const char *task = std::getenv("SLURM_ARRAY_TASK_ID");
  if (array != nullptr && task != nullptr) return fmt::format("{}_{}", array, task);
  const char *job = std::getenv("SLURM_JOB_ID");
  return job == nullptr ? "" : job;
}

// Raises the limit on open files, which is lower than some numbers of shards, as far as the system lets a process.
void allow_open_files() {
  rlimit limit{};
  if (::getrlimit(RLIMIT_NOFILE, &limit) != 0) return;
  limit.rlim_cur = limit.rlim_max;
  ::setrlimit(RLIMIT_NOFILE, &limit);
}

}  // namespace

Result<void> expect_plan_of(const std::string &folder, const std::string &plan) {
  const std::string file = plan_file(folder);
  if (!std::filesystem::exists(file)) return {};
  const Result<std::string> there = trace::read_file(file);
  if (!there) return tl::unexpected<Diagnostics>(there.error());
  return expect_plan(file, *there, plan);
}

Result<UnitStore> open_folder(const std::string &folder, const std::string &plan) {
  if (Result<void> same = expect_plan_of(folder, plan); !same) {
    return tl::unexpected<Diagnostics>(std::move(same.error()));
  }
  if (const std::string file = plan_file(folder); !std::filesystem::exists(file)) {
    Result<trace::OutputFile> output = trace::OutputFile::create(file);
    if (!output) return tl::unexpected<Diagnostics>(std::move(output.error()));
    output->write(plan);
    if (Result<void> written = output->commit(); !written) {
      return tl::unexpected<Diagnostics>(std::move(written.error()));
    }
  }
  const std::string units = units_file(folder);
  const std::string former = folder + "/units.csv";
  if (!std::filesystem::exists(units) && std::filesystem::exists(former)) {
    return file_error(former, 0, "holds results of an earlier version of redag", "choose another folder");
  }
  Result<UnitStore> store = UnitStore::open(units, subject(plan));
  if (store) sync_folder(folder);
  return store;
}

Result<std::string> read_plan(const std::string &folder) {
  Result<std::string> plan = trace::read_file(plan_file(folder));
  if (!plan) plan.error().front().hint = "is this the folder of an experiment (--out)?";
  return plan;
}

Result<void> visit_units(const std::vector<std::string> &folders, const std::string &plan, const Accept &accept) {
  struct Source {
    std::string file;
    UnitStore store;
    UnitCursor cursor;
  };
  std::vector<std::unique_ptr<Source>> sources;
  const auto later = [](const Source *a, const Source *b) { return a->cursor.unit().unit > b->cursor.unit().unit; };
  std::priority_queue<Source *, std::vector<Source *>, decltype(later)> queue(later);
  const auto advance = [&queue](Source *source) -> Result<void> {
    const Result<bool> more = source->cursor.next();
    if (!more) return tl::unexpected<Diagnostics>(more.error());
    if (*more) queue.push(source);
    return {};
  };
  allow_open_files();
  for (const std::string &folder : std::set<std::string>(folders.begin(), folders.end())) {
    const Result<std::string> there = read_plan(folder);
    if (!there) return tl::unexpected<Diagnostics>(there.error());
    if (Result<void> same = expect_plan(plan_file(folder), *there, plan); !same) return same;
    Result<UnitStore> store = UnitStore::read(units_file(folder), subject(plan));
    if (!store) return tl::unexpected<Diagnostics>(std::move(store.error()));
    Result<UnitCursor> cursor = store->units();
    if (!cursor) return tl::unexpected<Diagnostics>(std::move(cursor.error()));
    sources.push_back(std::make_unique<Source>(Source{units_file(folder), std::move(*store), std::move(*cursor)}));
    if (Result<void> begun = advance(sources.back().get()); !begun) return begun;
  }
  std::optional<FinishedUnit> last;
  while (!queue.empty()) {
    Source *source = queue.top();
    queue.pop();
    const FinishedUnit &unit = source->cursor.unit();
    if (last && last->unit == unit.unit) {
      if (last->result != unit.result) return two_results(source->file, unit.unit, last->result, unit.result);
    } else {
      if (Result<void> accepted = accept(unit.unit, unit.result); !accepted) return accepted;
      last = unit;
    }
    if (Result<void> moved = advance(source); !moved) return moved;
  }
  return {};
}

Result<void> log_run(const std::string &folder, const RunBegin &run) {
  const trace::Machine machine = trace::this_machine();
  Json json = stamp("begin");
  json["provenance"] = Json::parse(provenance_to_json(current_provenance()));
  json["version"] = kVersion;
  json["machine"] = {{"cpus", machine.cpus}, {"kernel", machine.kernel}, {"model", machine.model}};
  if (const std::string job = slurm_job(); !job.empty()) json["slurm_job"] = job;
  json["shard"] = to_string(run.shard);
  json["jobs"] = run.jobs;
  json["ranks"] = run.ranks;
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
      if (!json_is_too_large(line) && Json::accept(line)) lines.emplace_back(line);
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
