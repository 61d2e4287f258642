// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/peers/wait_set.hpp"

#include <algorithm>
#include <vector>

#include "redag_analysis/core/arithmetic.hpp"
#include "redag_analysis/core/rate_edges.hpp"
#include "redag_analysis/many_workers/global.hpp"

namespace redag::analysis {
namespace {

// The responses from readiness to finish, by TaskId.
std::vector<Duration> responses_from_ready(const TaskSet &task_set) {
  Duration all = 0;
  for (const CompiledTask &task : task_set.tasks) all = add(all, task.wcet);
  std::vector<Duration> result(task_set.tasks.size());
  Duration before = 0;  // timers are registered before subscriptions, each in the order of TaskIds
  for (const bool data : {false, true}) {
    for (std::size_t t = 0; t < task_set.tasks.size(); ++t) {
      const CompiledTask &task = task_set.tasks[t];
      if (task.data != data) continue;
      result[t] = add(task.wcet, add(all - task.wcet, before) / task_set.platform.workers);
      before = add(before, task.wcet);
    }
  }
  return result;
}

ResponseBound bound_of(const TaskSet &task_set, const Unit &unit, const std::vector<Duration> &from_ready) {
  std::vector<Duration> paths(task_set.tasks.size(), 0);  // the longest sum that ends with a task; `own`: its
                                                          // executions alone
  std::vector<Duration> own(task_set.tasks.size(), 0);
  std::uint32_t last = unit.tasks.front();
  for (const std::uint32_t t : unit.tasks) {
    for (const std::uint32_t p : task_set.tasks[t].predecessors) {
      if (paths[p] <= paths[t]) continue;
      paths[t] = paths[p];
      own[t] = own[p];
    }
    paths[t] = add(paths[t], from_ready[t]);
    own[t] = add(own[t], task_set.tasks[t].wcet);
    if (paths[t] > paths[last]) last = t;
  }
  ResponseBound bound;
  const Duration response = add(paths[last], unit.jitter);
  if (response > std::min(unit.limit, unit.period)) {
    bound.absent = global::kExceedsLimit;
    return bound;
  }
  bound.response = response;
  bound.terms.push_back(Term{Term::Kind::Own, TaskId(), unit.dag, own[last], 1});
  bound.terms.push_back(Term{Term::Kind::Blocking, TaskId(), DagId(), paths[last] - own[last], 0});
  if (unit.jitter > 0) bound.terms.push_back(Term{Term::Kind::Jitter, TaskId(), unit.dag, unit.jitter, 0});
  return bound;
}

Outcome apply_wait_set(const TaskSet &task_set) {
  if (auto reason = why_not_directly(task_set)) return NotApplicable{*reason};
  if (task_set.mode != sched::Preemption::None) return NotApplicable{"rclcpp's executors do not preempt"};
  if (!task_set.groups.empty())
    return NotApplicable{"with exclusive groups, the callbacks of a busy group can miss every window"};
  const std::vector<Duration> from_ready = responses_from_ready(task_set);
  std::vector<ResponseBound> responses;
  for (const Unit &unit : task_set.units) responses.push_back(bound_of(task_set, unit, from_ready));
  return from_units(task_set, std::move(responses));
}

}  // namespace

Method wait_set() {
  return Method{
      .name = "wait_set",
      .subject = Subject::Dag,
      .cite =
          "docs/analysis.md, \"rclcpp's executors\"; windows: D. Casini, T. Blass, I. Luetkebohle, B. Brandenburg, "
          "Response-time analysis of ROS 2 processing chains under reservation-based scheduling, ECRTS 2019",
      .assumptions =
          "rclcpp's single- or multi-threaded executor of Humble, m threads with processors of their own; one rate per "
          "DAG with edges, R <= T; no shared exclusive groups",
      .complexity = "O(tasks + edges)",
      .apply = apply_wait_set,
  };
}

}  // namespace redag::analysis
