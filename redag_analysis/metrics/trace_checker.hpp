// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Holds a trace to docs/model.md: replays the events and reports every place where they say something that the model
// forbids. Independent of the scheduler's code; near-linear in the number of events. Pure function.
//
// Simultaneous events: several decisions can share one time. A choice against an eligible job counts as a violation
// only if that job has still not started when time moves on; states (free workers, priorities) are judged when time
// moves on, preemptions when the more urgent job gets the worker.
#pragma once

#include "redag/trace/trace.hpp"
#include "redag_analysis/metrics/check_report.hpp"

namespace redag::metrics {

/// The rules that a run's trace can be held to. Those of rclcpp's executors and their models follow no priorities. What
/// is between a release and a body (threads, messages under way) the nodes of a ROS 2 workload do not see, so that
/// nothing is said about priorities or idle workers there.
[[nodiscard]] RuleSet rules_for(const trace::RunInfo &info);

/// A trace with lost events has holes: that is its one violation, and nothing else is checked.
[[nodiscard]] CheckReport check_trace(const trace::Trace &trace, const RuleSet &rules = RuleSet::all());

}  // namespace redag::metrics
