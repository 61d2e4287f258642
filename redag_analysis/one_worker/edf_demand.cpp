// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/one_worker/edf_demand.hpp"

#include <algorithm>

#include "redag_analysis/core/arithmetic.hpp"
#include "redag_analysis/core/effort.hpp"
#include "redag_analysis/core/rate_edges.hpp"

namespace redag::analysis {
namespace {

constexpr int kMaxIntervals = 1'000'000;

// A task as the demand sees it. Its deadline counts from its release as seen, which jitter delays.
struct Demand {
  Duration wcet = 0;
  Duration period = 0;
  Duration deadline = 0;  // D - J
  Duration blocking = 0;  // its longest stretch without a preemption point, minus one
  Duration nominal_deadline = 0;
};

std::optional<std::string> why_not_edf(const TaskSet &task_set) {
  if (task_set.platform.workers != 1)
    return "requires one worker, but the platform has " + std::to_string(task_set.platform.workers);
  if (task_set.policy != PolicyKind::Edf)
    return std::string("requires edf, but the policy is ") + to_string(task_set.policy);
  if (task_set.has_edges()) return "tasks have predecessors";
  if (auto reason = why_not_directly(task_set)) return reason;
  if (task_set.mode != sched::Preemption::None) {
    if (!task_set.groups.empty()) return "groups cannot be combined with preemption";
    for (const CompiledDag &dag : task_set.dags) {
      if (dag.max_active > 0 && dag.tasks.size() > 1) return "DAG '" + dag.name + "' has a max_active";
    }
  }
  for (const CompiledTask &task : task_set.tasks) {
    if (task.deadline > task.limit) return "task '" + task.name + "': jobs can be skipped before their deadline";
    if (task.deadline <= task.jitter) return "task '" + task.name + "': its jitter is not below its deadline";
    const Duration end_to_end = task_set.dags[task.dag.value].deadline;
    if (end_to_end > 0 && end_to_end < task.deadline) {
      return "DAG '" + task_set.dags[task.dag.value].name + "': its deadline is below those of its tasks";
    }
  }
  return std::nullopt;
}

std::vector<Demand> demands_of(const TaskSet &task_set) {
  std::vector<Demand> demands;
  for (const CompiledTask &task : task_set.tasks) {
    const Duration blocking = std::max<Duration>(0, task.region - 1);
    demands.push_back(Demand{task.wcet, task.period, task.deadline - task.jitter, blocking, task.deadline});
  }
  return demands;
}

Duration demand_until(const std::vector<Demand> &demands, Duration t) {
  Int128 sum = 0;
  Effort::spend(demands.size());
  for (const Demand &task : demands) {
    if (t >= task.deadline) sum += Int128{(t - task.deadline) / task.period + 1} * task.wcet;
  }
  return saturate(sum);
}

// The length of the longest busy period, blocking included; empty if the steps run out. T + J: releases as seen.
std::optional<Duration> busy_period(const std::vector<Demand> &demands, Duration blocking) {
  Duration length = 1;
  for (int step = 0; step < kMaxIntervals && length < kUnbounded; ++step) {
    Int128 sum = blocking;
    Effort::spend(demands.size());
    for (const Demand &task : demands) {
      const Duration jitter = task.nominal_deadline - task.deadline;
      sum += Int128{ceil_div(add(length, jitter), task.period)} * task.wcet;
    }
    const Duration next = saturate(sum);
    if (next == length) return length;
    length = next;
  }
  return std::nullopt;
}

// The largest absolute deadline below `t`, or 0.
Duration deadline_below(const std::vector<Demand> &demands, Duration t) {
  Duration latest = 0;
  for (const Demand &task : demands) {
    if (task.deadline >= t) continue;
    latest = std::max(latest, (t - 1 - task.deadline) / task.period * task.period + task.deadline);
  }
  return latest;
}

Bound refuse(Duration t, Duration demand) {
  Bound bound;
  bound.accepts = false;
  bound.figures = "demand " + std::to_string(demand) + " in an interval of " + std::to_string(t) + " ns";
  return bound;
}

Bound refuse_overload() {
  Bound bound;
  bound.accepts = false;
  bound.figures = "the busy period has no bound, because the utilization is about one or more";
  return bound;
}

Bound accept() {
  Bound bound;
  bound.accepts = true;
  bound.figures = "the demand fits into every interval";
  return bound;
}

// QPA: steps backwards from the end of the busy period, each time as far as the demand itself reaches.
Outcome apply_edf_preemptive(const TaskSet &task_set) {
  if (auto reason = why_not_edf(task_set)) return NotApplicable{*reason};
  if (task_set.mode != sched::Preemption::Full) return NotApplicable{"requires full preemption"};
  const std::vector<Demand> demands = demands_of(task_set);
  const auto length = busy_period(demands, 0);
  if (!length) return refuse_overload();
  Duration t = deadline_below(demands, add(*length, 1));
  for (int step = 0; t > 0; ++step) {
    if (step == kMaxIntervals) return NotApplicable{"gave up: too many intervals must be examined"};
    const Duration demand = demand_until(demands, t);
    if (demand > t) return refuse(t, demand);
    // Between the demand and t no deadline can be missed; at equality the next deadline decides.
    t = deadline_below(demands, demand < t ? demand + 1 : t);
  }
  return accept();
}

Outcome apply_edf_nonpreemptive(const TaskSet &task_set) {
  if (auto reason = why_not_edf(task_set)) return NotApplicable{*reason};
  if (task_set.mode == sched::Preemption::Full) return NotApplicable{"requires jobs that keep the worker"};
  const std::vector<Demand> demands = demands_of(task_set);
  Duration longest = 0;
  for (const Demand &task : demands) longest = std::max(longest, task.blocking);
  const auto length = busy_period(demands, longest);
  if (!length) return refuse_overload();
  // Blocking falls with t. The demand can therefore not be followed backwards, and every deadline is examined.
  int step = 0;
  for (Duration t = deadline_below(demands, add(*length, 1)); t > 0; t = deadline_below(demands, t)) {
    if (++step > kMaxIntervals) return NotApplicable{"gave up: too many intervals must be examined"};
    Duration blocking = 0;
    for (const Demand &task : demands) {
      if (task.nominal_deadline > t) blocking = std::max(blocking, task.blocking);
    }
    const Duration demand = add(demand_until(demands, t), blocking);
    if (demand > t) return refuse(t, demand);
  }
  return accept();
}

}  // namespace

Method edf_demand() {
  return Method{
      .name = "edf_demand",
      .subject = Subject::TaskSet,
      .cite =
          "S. Baruah, L. Rosier, R. Howell, Algorithms and complexity concerning the preemptive scheduling of "
          "periodic, real-time tasks on one processor, Real-Time Systems 2, 1990; F. Zhang, A. Burns, Schedulability "
          "analysis for real-time systems with EDF scheduling, IEEE Transactions on Computers 58(9), 2009",
      .assumptions =
          "one worker, full preemption, edf, no edges, deadlines before the next release is refused, jitter below the "
          "deadline, no shared groups, no max_active",
      .complexity = "pseudo-polynomial; O(n) per interval",
      .apply = apply_edf_preemptive,
  };
}

Method edf_demand_nonpreemptive() {
  return Method{
      .name = "edf_demand_nonpreemptive",
      .subject = Subject::TaskSet,
      .cite =
          "K. Jeffay, D. Stanat, C. Martel, On non-preemptive scheduling of periodic and sporadic tasks, RTSS 1991; L. "
          "George, N. Rivierre, M. Spuri, Preemptive and non-preemptive real-time uni-processor scheduling, INRIA "
          "RR-2966, 1996",
      .assumptions =
          "one worker, jobs run to completion or to a preemption point, edf, no edges, deadlines before the next "
          "release "
          "is refused, jitter below the deadline; groups and max_active where jobs run to completion",
      .complexity = "pseudo-polynomial; O(n) per interval",
      .apply = apply_edf_nonpreemptive,
  };
}

}  // namespace redag::analysis
