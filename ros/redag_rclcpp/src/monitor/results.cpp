// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "results.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <system_error>
#include <utility>

#include "redag/trace/this_machine.hpp"
#include "redag/trace/trace.hpp"
#include "redag_analysis/metrics/files/summary_json.hpp"

namespace redag_rclcpp {

redag::Result<void> prepare_folder(const std::string &path) {
  std::error_code error;
  std::filesystem::create_directories(path, error);
  if (error) return redag::make_error(fmt::format("cannot create folder '{}': {}", path, error.message()));
  if (access(path.c_str(), W_OK | X_OK) != 0)
    return redag::make_error(fmt::format("cannot write to folder '{}'", path));
  return {};
}

void TraceKeeper::add(const std::vector<redag::JobEvent> &events) {
  const std::size_t room = most_ - events_.size();
  const auto end = events.begin() + static_cast<std::ptrdiff_t>(std::min(room, events.size()));
  events_.insert(events_.end(), events.begin(), end);
  if (events.size() > room) is_cut_ = true;
}

redag::Diagnostics TraceKeeper::write(const redag::metrics::FilesOptions &files, const ReDAGExecutor &executor) {
  redag::Diagnostics problems;
  const auto keep = [&problems](const redag::Result<void> &written) {
    if (!written) problems.insert(problems.end(), written.error().begin(), written.error().end());
  };
  redag::trace::Trace trace = executor.as_trace(std::move(events_));
  add_provenance(trace.info);
  // The kept events describe a run that ended with the last of them.
  if (is_cut_ && !trace.events.empty()) trace.info.end = trace.events.back().time;

  const redag::metrics::Summary summary = redag::metrics::summarize(trace);
  keep(redag::metrics::write_summary(files.folder + "/summary.json", summary, trace.info));
  redag::Result<std::string> names = redag::metrics::write_run_files(files, trace);
  if (names) {
    names_ = "summary.json, " + *names;
  } else {
    problems.insert(problems.end(), names.error().begin(), names.error().end());
  }
  return problems;
}

std::optional<std::string> RunRecord::prepare(const std::string &folder) {
  path_ = fmt::format("{}/{}", folder, redag::trace::kEventsFile);
  // A robot must start again after a crash, and its user may want the record.
  redag::Result<std::string> aside = redag::trace::move_unfinished_aside(path_);
  if (!aside || aside->empty()) return std::nullopt;
  return *std::move(aside);
}

redag::Result<void> RunRecord::add(const std::vector<redag::JobEvent> &events, const ReDAGExecutor &executor) {
  if (broken_ || (events.empty() && !file_)) return {};
  redag::Result<void> kept = describe(events, executor).and_then([&] {
    file_->add(events);
    return file_->flush(executor.lost_events());
  });
  broken_ = !kept;
  return kept;
}

// Describes the run again when new tasks have appeared, their rates were learned, or a deadlock has begun or ended.
redag::Result<void> RunRecord::describe(const std::vector<redag::JobEvent> &events, const ReDAGExecutor &executor) {
  const bool is_known = std::all_of(events.begin(), events.end(),
                                    [this](const auto &event) { return event.task.value < positions_.size(); });
  const bool was_learning = std::exchange(learning_, !executor.learning_done());
  const redag::Time before = deadlocks_;
  for (const Deadlock &deadlock : executor.deadlocks()) {
    deadlocks_ = std::max({deadlocks_, deadlock.begun, deadlock.ended == redag::kNever ? 0 : deadlock.ended});
  }
  if (is_known && was_learning == learning_ && before == deadlocks_) return {};
  redag::trace::RunInfo info = executor.run_info(positions_);
  add_provenance(info);
  if (file_) return file_->describe(info, positions_);
  return redag::trace::EventsWriter::record(path_, info, redag::trace::kMostRecordBytes, positions_)
      .map([this](redag::trace::EventsWriter &&file) { file_.emplace(std::move(file)); });
}

}  // namespace redag_rclcpp
