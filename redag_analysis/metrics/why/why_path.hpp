// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Puts the stretches of jobs (why_waits.hpp) together along the data that they waited for. Internal to metrics/.
#pragma once

#include <vector>

#include "redag/trace/trace.hpp"
#include "redag_analysis/metrics/why/why_links.hpp"
#include "redag_analysis/metrics/why/why_waits.hpp"

namespace redag::metrics {

class WhyPath {
 public:
  WhyPath(const trace::RunInfo &info, const JobLinks &links) : info_(info), links_(links) {}

  /// Returns parts whose lengths sum to end - begin. Requires begin <= end, and that the job and all jobs on its way
  /// have ended and were followed, with the names of their holders. Call once.
  [[nodiscard]] std::vector<Part> parts_of(const LinkedJob &job, Time begin, Time end, bool end_to_end);

 private:
  // Each adds the time [begin, end) of a job. `on_way`: the job's work is part of the explained job's own way, and not
  // a wait of it.
  void walk(const LinkedJob &job, Time begin, Time end, bool on_way);
  void before_release(const LinkedJob &job, Time begin, Time end, bool on_way);
  void unreleased(const LinkedJob &job, Time begin, Time end);
  void wait_for_data(const LinkedJob &job, Time begin, Time end, bool on_way);
  void late_release(const LinkedJob &job, Time begin, Time end);
  void add(const LinkedJob &job, Cause cause, Time begin, Time end, JobId by = {});

  void on_worker(const LinkedJob &job, const Wait &wait, Time begin, Time end, bool on_way, Duration &used);
  void measure(const LinkedJob &job, std::size_t first, Time begin, Time end);
  [[nodiscard]] bool is_simulated() const { return info_.driver == trace::Driver::Simulator; }

  const trace::RunInfo &info_;
  const JobLinks &links_;
  const LinkedJob *explained_ = nullptr;
  bool end_to_end_ = false;
  std::vector<Part> parts_;
};

}  // namespace redag::metrics
