// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The files of a run that hold each event or job: events.redag, jobs.csv, and the picture trace.pftrace
// (docs/results_format.md). They are written as events arrive, in memory that does not grow with the run, and appear
// when the run is over. Not thread-safe.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "redag/base/result.hpp"
#include "redag/trace/events_file.hpp"
#include "redag/trace/trace.hpp"
#include "redag_analysis/metrics/files/jobs_csv.hpp"
#include "redag_analysis/metrics/perfetto/perfetto.hpp"

namespace redag::metrics {

/// A picture has about 150 bytes for each event; of longer runs it would be most of the results, and more than a
/// browser opens with ease.
inline constexpr std::uint64_t kMostPicturedEvents = 500'000;

struct FilesOptions {
  std::string folder;                                 // exists; empty: no files
  std::uint64_t most_pictured = kMostPicturedEvents;  // runs with more events have no picture
};

class RunFiles {
 public:
  /// Of `run`, the end and the lost events are not used. Errors: an unwritable folder.
  [[nodiscard]] static Result<RunFiles> create(const FilesOptions &options, const trace::RunInfo &run);

  void add(std::span<const JobEvent> events);

  /// Completes the files, and deletes those of an earlier run that this one does not replace. Returns what failed.
  [[nodiscard]] Diagnostics commit(Time end, std::uint64_t lost_events);

  /// The names of the files, once they are complete: "jobs.csv, events.redag".
  [[nodiscard]] std::string names() const;
  [[nodiscard]] bool has_picture() const { return picture_.has_value(); }

 private:
  RunFiles(FilesOptions options, const trace::RunInfo &run, trace::EventsWriter events, JobsCsvWriter jobs)
      : options_(std::move(options)),
        run_(std::make_unique<trace::RunInfo>(run)),
        events_(std::move(events)),
        jobs_(std::move(jobs)) {}

  [[nodiscard]] std::string path(std::string_view name) const { return options_.folder + "/" + std::string(name); }

  FilesOptions options_;
  std::unique_ptr<trace::RunInfo> run_;  // the picture refers to it
  trace::EventsWriter events_;
  JobsCsvWriter jobs_;
  std::optional<PerfettoWriter> picture_;
  std::uint64_t count_ = 0;
};

/// Writes all files of a run in memory, and returns their names. Error: everything that failed.
[[nodiscard]] Result<std::string> write_run_files(const FilesOptions &options, const trace::Trace &trace);

}  // namespace redag::metrics
