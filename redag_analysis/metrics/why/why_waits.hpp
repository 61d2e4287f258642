// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// What kept chosen jobs from ending at every instant, as the decisions in a trace tell it, while its events pass by.
// Internal to metrics/. Not thread-safe.
#pragma once

#include <functional>
#include <memory>

#include "redag/trace/trace.hpp"
#include "redag_analysis/metrics/why/why_links.hpp"

namespace redag::metrics {

/// Fills LinkedJob::waits of the jobs that it follows.
class WaitWatch {
 public:
  using IsChosen = std::function<bool(const JobId &)>;

  /// Follows the jobs for which `is_chosen` returns true. `run` must outlive this object.
  WaitWatch(const trace::RunInfo &run, IsChosen is_chosen);
  WaitWatch(WaitWatch &&) = delete;
  ~WaitWatch();

  /// Continues from the last call, and passes each event on to `links`.
  void add(const JobEvent &event, JobLinks &links);
  /// Ends the run.
  void finish(JobLinks &links);

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

/// True if it is known which of the holders of all waits of the job was the first to end.
[[nodiscard]] bool has_known_holders(const LinkedJob &job);
/// Names it, as the cause of each wait. Requires that it is known.
void name_holders(LinkedJob &job);

}  // namespace redag::metrics
