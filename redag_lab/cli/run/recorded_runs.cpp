// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/cli/run/recorded_runs.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <set>
#include <system_error>

#include "redag/base/text.hpp"
#include "redag/loader/text_file.hpp"
#include "redag_lab/cli/terminal/files.hpp"
#include "redag_lab/cli/terminal/json.hpp"

namespace redag::cli {
namespace {

namespace fs = std::filesystem;

// Returns the folder that holds a run's repetitions, or the run's own folder. The path is absolute and gives "." a name
// too.
fs::path subject_of(const std::string &trace) {
  fs::path folder = fs::absolute(trace).lexically_normal().parent_path();
  if (folder.filename().string().rfind("repetition-", 0) == 0) folder = folder.parent_path();
  return folder;
}

std::string last_parts(const fs::path &path, std::size_t count) {
  std::vector<std::string> parts;
  for (const fs::path &part : path.relative_path()) parts.push_back(part.string());
  std::string text;
  for (std::size_t i = parts.size() - std::min(count, parts.size()); i < parts.size(); ++i) {
    text += (text.empty() ? "" : "/") + parts[i];
  }
  return text;
}

// Returns for each subject the shortest end of its path that is unique.
std::vector<std::string> labels_of(const std::vector<fs::path> &subjects) {
  std::vector<std::string> labels;
  for (const fs::path &subject : subjects) {
    const auto depth = static_cast<std::size_t>(std::distance(subject.begin(), subject.end()));
    std::size_t parts = 1;
    const auto shared = [&](const fs::path &other) {
      return other != subject && last_parts(other, parts) == last_parts(subject, parts);
    };
    while (parts < depth && std::any_of(subjects.begin(), subjects.end(), shared)) ++parts;
    labels.push_back(last_parts(subject, parts));
  }
  return labels;
}

// Reads from a comparison the order of its runs, and its warnings.
Result<void> read_comparison(const fs::path &file, std::vector<std::string> &order, std::vector<std::string> &notes) {
  std::error_code error;
  if (!fs::exists(file, error)) return {};
  const Result<std::string> text = read_file(file.string());
  if (!text) return tl::unexpected<Diagnostics>(text.error());
  const auto bad = [&] { return file_error(file.string(), 1, "the file was not written by 'redag compare'"); };
  if (json_is_too_large(*text)) return bad();
  const Json json = Json::parse(*text, nullptr, false);
  if (!json.is_object() || json.value("format", Json()) != "redag.comparison/3") return bad();
  for (const Json &executor : json.value("executors", Json::array())) {
    if (!executor.is_object() || !executor.contains("name") || !executor["name"].is_string()) return bad();
    order.push_back(executor["name"]);
  }
  const Json caveat = json.value("caveat", Json(""));
  if (caveat.is_string() && !caveat.get<std::string>().empty()) notes.push_back(caveat);
  for (const Json &warning : json.value("warnings", Json::array())) {
    if (warning.is_string()) notes.push_back(warning);
  }
  return {};
}

std::size_t place_in(const std::vector<std::string> &order, const fs::path &subject) {
  return static_cast<std::size_t>(std::find(order.begin(), order.end(), subject.filename().string()) - order.begin());
}

// Returns how many deadlines a run missed, as its summary.json says; 0 without one.
std::uint64_t missed_in(const std::string &trace) {
  const Result<std::string> text = read_file((fs::path(trace).parent_path() / "summary.json").string());
  if (!text || json_is_too_large(*text)) return 0;
  const Json json = Json::parse(*text, nullptr, false);
  if (!json.is_object() || !json.contains("total") || !json["total"].is_object()) return 0;
  const Json missed = json["total"].value("missed", Json());
  return missed.is_number_unsigned() ? missed.get<std::uint64_t>() : 0;
}

}  // namespace

std::size_t RecordedPlaces::traces() const {
  std::size_t count = 0;
  for (const RecordedRuns &each : runs) count += each.traces.size();
  return count;
}

Result<RecordedPlaces> find_recorded_runs(const std::vector<std::string> &places) {
  RecordedPlaces found;
  std::vector<fs::path> subjects;
  std::set<fs::path> seen;
  for (const std::string &place : places) {
    Result<std::vector<std::string>> traces = find_traces(place);
    if (!traces) return tl::unexpected<Diagnostics>(std::move(traces.error()));
    std::vector<std::string> order;
    const Result<void> read = read_comparison(fs::path(place) / "comparison.json", order, found.notes);
    if (!read) return tl::unexpected<Diagnostics>(read.error());
    std::stable_sort(traces->begin(), traces->end(), [&](const std::string &a, const std::string &b) {
      return place_in(order, subject_of(a)) < place_in(order, subject_of(b));
    });
    for (const std::string &trace : *traces) {
      if (!seen.insert(fs::absolute(trace).lexically_normal()).second) continue;
      const fs::path subject = subject_of(trace);
      const auto known = std::find(subjects.begin(), subjects.end(), subject);
      if (known == subjects.end()) {
        subjects.push_back(subject);
        found.runs.push_back({{}, {trace}});
      } else {
        found.runs[static_cast<std::size_t>(known - subjects.begin())].traces.push_back(trace);
      }
    }
  }
  const std::vector<std::string> labels = labels_of(subjects);
  for (std::size_t i = 0; i < labels.size(); ++i) found.runs[i].label = labels[i];
  return found;
}

Result<ChosenRun> choose_run(const std::string &place) {
  const Result<RecordedPlaces> found = find_recorded_runs({place});
  if (!found) return tl::unexpected<Diagnostics>(found.error());
  const RecordedRuns &first = found->runs.front();
  if (found->traces() == 1) return ChosenRun{first.traces.front(), {}};
  const auto folder_of = [](const std::string &trace) { return fs::path(trace).parent_path().string(); };
  std::error_code ignored;
  if (found->runs.size() > 1 && !fs::exists(fs::path(place) / "comparison.json", ignored)) {
    return make_error(fmt::format("{} holds {} runs", in_quotes(place), found->traces()),
                      fmt::format("name one of them, such as {}", in_quotes(folder_of(first.traces.front()))));
  }
  std::size_t worst = 0;
  std::uint64_t most = 0;
  for (std::size_t i = 0; i < first.traces.size(); ++i) {
    const std::uint64_t missed = missed_in(first.traces[i]);
    if (missed <= most) continue;
    worst = i;
    most = missed;
  }
  const std::string why = most == 0 ? fmt::format("the first of {}: no repetition missed a deadline", first.label)
                                    : fmt::format("in which {} missed most deadlines ({})", first.label, most);
  return ChosenRun{first.traces[worst], fmt::format("{} holds {} runs; this is {}, {}\n", place, found->traces(),
                                                    folder_of(first.traces[worst]), why)};
}

void warn_of_remarks(const trace::RunInfo &run, Console &console) {
  for (const trace::Remark &remark : run.remarks) {
    console.warn(
        fmt::format("noticed {} after the start: {}", humanize_duration(remark.begun - run.start), remark.text));
  }
}

}  // namespace redag::cli
