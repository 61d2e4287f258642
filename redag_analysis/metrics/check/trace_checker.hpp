// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Holds a trace to docs/model.md: replays the events and reports each one that contradicts the model. Near-linear in
// the number of events, in memory that does not grow with it. Not thread-safe. Only sched::assign_priorities,
// sched::is_static and the table of executors are shared with the scheduler; all other rules are written again from the
// model.
//
// Several decisions can share one time. A choice against an eligible job is a violation only if that job has still not
// started when time moves on. States (free workers, priorities) are judged when time moves on, and preemptions when the
// more urgent job gets the worker.
#pragma once

#include <memory>
#include <span>

#include "redag/trace/trace.hpp"
#include "redag_analysis/metrics/check/check_report.hpp"

namespace redag::metrics {

/// Returns the rules for a run. Those for rclcpp's executors and their models contain no priorities. The nodes of a ROS
/// 2 workload do not see what is between a release and a body (threads, messages under way). Their rules therefore do
/// not cover priorities or idle workers.
[[nodiscard]] RuleSet rules_for(const trace::RunInfo &info);

class TraceChecker {
 public:
  /// Of `run`, the end and the lost events are not used.
  explicit TraceChecker(const trace::RunInfo &run, const RuleSet &rules = RuleSet::all());
  TraceChecker(TraceChecker &&) noexcept;
  TraceChecker &operator=(TraceChecker &&) = delete;
  TraceChecker(const TraceChecker &) = delete;
  TraceChecker &operator=(const TraceChecker &) = delete;
  ~TraceChecker();

  /// Checks the next events.
  void add(std::span<const JobEvent> events);
  /// Ends the run at `end`. With lost events, their loss is the one violation. Call once.
  [[nodiscard]] CheckReport finish(Time end, std::uint64_t lost_events);

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

/// Checks a trace. For a trace with lost events this is the one violation, and nothing else is checked.
[[nodiscard]] CheckReport check_trace(const trace::Trace &trace, const RuleSet &rules = RuleSet::all());

}  // namespace redag::metrics
