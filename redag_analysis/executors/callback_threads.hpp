// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// What the models of rclcpp's executors share: threads that run one callback after the other, each to its end, without
// priorities or budgets. The model decides which callback is next. Not thread-safe.
#pragma once

#include <cstdint>
#include <vector>

#include "redag/sched/lifecycle.hpp"

namespace redag::executors {

/// Runs callbacks to completion; Lifecycle keeps the state of the jobs.
class CallbackThreads : public sched::Lifecycle {
 public:
  /// Does nothing: these executors know neither budgets nor criticality.
  void exceed(JobSlot /*job*/, sched::Limit /*limit*/, Time /*now*/) final {}
  void preemption_point(JobSlot job, Time now) final;
  sched::Step dispatch(Time now, std::uint32_t most = sched::kNoLimit) final;
  [[nodiscard]] bool outranked(JobSlot /*job*/) const final { return false; }

 protected:
  /// Requires config.workers > 0 and Preemption::None.
  explicit CallbackThreads(const sched::Config &config, TimerReleases timer_releases = TimerReleases::AsTheTaskSays);

  /// Removes and returns the ready job that a free thread runs next; kNil if there is none for it.
  virtual std::uint32_t take() = 0;
  /// Called before the free threads take their jobs.
  virtual void before_taking() {}
  /// Called when a started job has ended and its thread is free.
  virtual void on_over(std::uint32_t slot) = 0;

 private:
  void on_end(std::uint32_t slot) final;
  void on_lowered(std::uint32_t /*slot*/) final {}

  std::vector<bool> working_;  // by thread
};

}  // namespace redag::executors
