// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// What the models of rclcpp's executors share: threads that run one callback after the other, each to its end, and know
// neither priorities nor budgets. Which one is next, the model says. Not thread-safe.
#pragma once

#include <cstdint>
#include <vector>

#include "redag/sched/lifecycle.hpp"

namespace redag::sched {

/// A job's life is Lifecycle's.
class CallbackThreads : public Lifecycle {
 public:
  /// Nothing: these executors know neither budgets nor criticality.
  void exceed(JobSlot /*job*/, Limit /*limit*/, Time /*now*/) final {}
  void preemption_point(JobSlot job, Time now) final;
  Step dispatch(Time now, std::uint32_t most = kNoLimit) final;
  [[nodiscard]] bool outranked(JobSlot /*job*/) const final { return false; }

 protected:
  /// Requires config.workers > 0 and Preemption::None.
  explicit CallbackThreads(const Config &config, TimerReleases timer_releases = TimerReleases::AsTheTaskSays);

  /// The ready job that a free thread runs next, which is then no longer ready; kNil if there is none for it.
  virtual std::uint32_t take() = 0;
  /// Before the free threads take their jobs.
  virtual void before_taking() {}
  /// A started job has ended; its thread is free.
  virtual void on_over(std::uint32_t slot) = 0;

 private:
  void on_end(std::uint32_t slot) final;
  void on_lowered(std::uint32_t /*slot*/) final {}

  std::vector<bool> working_;  // threads
};

}  // namespace redag::sched
