// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/cli/run/recorded_runs.hpp"

#include <algorithm>
#include <filesystem>
#include <set>
#include <system_error>

#include "redag/base/text.hpp"
#include "redag/trace/output_file.hpp"
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

// Accepts this version and the previous one, which share the keys read here.
bool is_comparison(const Json &format) { return format == "redag.comparison/1" || format == "redag.comparison/2"; }

// Reads from a comparison the order of its runs, and its warnings.
Result<void> read_comparison(const fs::path &file, std::vector<std::string> &order, std::vector<std::string> &notes) {
  std::error_code error;
  if (!fs::exists(file, error)) return {};
  const Result<std::string> text = trace::read_file(file.string());
  if (!text) return tl::unexpected<Diagnostics>(text.error());
  const auto bad = [&] { return trace::file_error(file.string(), 1, "the file was not written by 'redag compare'"); };
  if (json_nests_deeper(*text)) return bad();
  const Json json = Json::parse(*text, nullptr, false);
  if (!json.is_object() || !is_comparison(json.value("format", Json()))) return bad();
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

}  // namespace redag::cli
