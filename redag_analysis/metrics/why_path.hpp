// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Puts the stretches of jobs (why_waits.hpp) together along the data that they waited for. Internal to metrics/.
#pragma once

#include <vector>

#include "redag/trace/trace.hpp"
#include "redag_analysis/metrics/why_kernel.hpp"
#include "redag_analysis/metrics/why_links.hpp"
#include "redag_analysis/metrics/why_waits.hpp"

namespace redag::metrics {

class WhyPath {
 public:
  /// `kernel` is null if there is no record.
  WhyPath(const trace::RunInfo &info, const JobLinks &links, const std::vector<std::vector<Wait>> &waits,
          const KernelView *kernel)
      : info_(info), links_(links), waits_(waits), kernel_(kernel) {}

  /// Returns parts whose lengths sum to end - begin. Requires begin <= end, and that the waits of the job and of all
  /// jobs on its way are known. Call once.
  [[nodiscard]] std::vector<Part> parts_of(std::size_t job, Time begin, Time end, bool end_to_end);

 private:
  using Stretch = KernelView::Stretch;

  // Each adds the time [begin, end) of a job. `on_way`: the job's work is part of the explained job's own way, and not
  // a wait of it.
  void walk(std::size_t job, Time begin, Time end, bool on_way);
  void before_release(std::size_t job, Time begin, Time end, bool on_way);
  void unreleased(std::size_t job, Time begin, Time end);
  void wait_for_data(std::size_t job, Time begin, Time end, bool on_way);
  void late_release(std::size_t job, Time begin, Time end);
  void add(std::size_t job, const Stretch &stretch, Time begin, Time end, JobId by = {});

  [[nodiscard]] std::vector<Stretch> on_worker(std::size_t job, const Wait &wait, Duration &used) const;
  void measure(std::size_t job, std::size_t first, Time begin, Time end);
  [[nodiscard]] bool is_simulated() const { return info_.driver == trace::Driver::Simulator; }
  [[nodiscard]] std::optional<int> thread_of(std::size_t job) const;
  [[nodiscard]] JobId id_of(std::size_t job) const { return {links_.jobs()[job].task, links_.jobs()[job].number}; }

  const trace::RunInfo &info_;
  const JobLinks &links_;
  const std::vector<std::vector<Wait>> &waits_;
  const KernelView *kernel_;
  std::size_t explained_ = JobLinks::kNone;
  bool end_to_end_ = false;
  std::vector<Part> parts_;
};

}  // namespace redag::metrics
