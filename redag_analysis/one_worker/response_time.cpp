// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/one_worker/response_time.hpp"

#include "redag_analysis/core/rate_edges.hpp"
#include "redag_analysis/one_worker/one_worker.hpp"
#include "redag_analysis/one_worker/task_bounds.hpp"

namespace redag::analysis {
namespace {

std::optional<std::string> why_not(const TaskSet &task_set, sched::Preemption mode, bool edges) {
  if (auto reason = one_worker::why_not(task_set)) return reason;
  if (edges && !task_set.has_edges()) return "no task has predecessors: see the bounds for independent tasks";
  if (!edges && task_set.has_edges()) return "tasks have predecessors: see the bounds for DAGs";
  if (task_set.mode == mode) return std::nullopt;
  switch (mode) {
    case sched::Preemption::None: return "requires jobs that run to completion, but jobs can be preempted here";
    case sched::Preemption::Cooperative: return "requires cooperative jobs with preemption points";
    case sched::Preemption::Full: break;
  }
  return "requires full preemption, but jobs keep the worker here until they end or reach a preemption point";
}

Outcome independent_full(const TaskSet &task_set) {
  if (auto reason = why_not(task_set, sched::Preemption::Full, false)) return NotApplicable{*reason};
  return one_worker::bound_tasks(task_set, false);
}

Outcome independent_none(const TaskSet &task_set) {
  if (auto reason = why_not(task_set, sched::Preemption::None, false)) return NotApplicable{*reason};
  return one_worker::bound_tasks(task_set, true);
}

Outcome independent_cooperative(const TaskSet &task_set) {
  if (auto reason = why_not(task_set, sched::Preemption::Cooperative, false)) return NotApplicable{*reason};
  return one_worker::bound_tasks(task_set, true);
}

Outcome dags_full(const TaskSet &task_set) {
  if (auto reason = why_not(task_set, sched::Preemption::Full, true)) return NotApplicable{*reason};
  return one_worker::bound_tasks(task_set, false);
}

Outcome dags_deferred(const TaskSet &task_set) {
  const auto mode =
      task_set.mode == sched::Preemption::Full ? sched::Preemption::None : task_set.mode;  // both None and Cooperative
                                                                                           // are accepted
  if (auto reason = why_not(task_set, mode, true)) return NotApplicable{*reason};
  return one_worker::bound_tasks(task_set, true);
}

}  // namespace

Method rta_preemptive() {
  return Method{
      .name = "rta_preemptive",
      .subject = Subject::Task,
      .cite =
          "M. Joseph, P. Pandya, Finding response times in a real-time system, The Computer Journal 29(5), 1986; K. "
          "Tindell, A. Burns, A. Wellings, An extendible approach for analysing fixed priority hard real-time tasks, "
          "Real-Time Systems 6(2), 1994",
      .assumptions =
          "one worker, full preemption, static priorities, edges only between rates; any deadlines, release jitter, "
          "shared "
          "groups with priority inheritance, shared levels",
      .complexity = "pseudo-polynomial; O(n) per step",
      .knows_waits = true,
      .apply = [](const TaskSet &task_set) { return across_rates(task_set, independent_full); },
  };
}

Method rta_nonpreemptive() {
  return Method{
      .name = "rta_nonpreemptive",
      .subject = Subject::Task,
      .cite =
          "R. Davis, A. Burns, R. Bril, J. Lukkien, Controller Area Network (CAN) schedulability analysis: Refuted, "
          "revisited and revised, Real-Time Systems 35(3), 2007",
      .assumptions =
          "one worker, jobs run to completion, static priorities, edges only between rates; any deadlines, release "
          "jitter, "
          "groups",
      .complexity = "pseudo-polynomial; O(n) per step, all jobs of the busy period",
      .apply = [](const TaskSet &task_set) { return across_rates(task_set, independent_none); },
  };
}

Method rta_deferred() {
  return Method{
      .name = "rta_deferred",
      .subject = Subject::Task,
      .cite =
          "R. Bril, J. Lukkien, W. Verhaegh, Worst-case response time analysis of real-time tasks under fixed-priority "
          "scheduling with deferred preemption, Real-Time Systems 42, 2009",
      .assumptions =
          "one worker, cooperative preemption points every `region`, static priorities, edges only between rates, no "
          "shared groups; any "
          "deadlines, release jitter, shared levels",
      .complexity = "pseudo-polynomial; O(n) per step, all jobs of the busy period",
      .apply = [](const TaskSet &task_set) { return across_rates(task_set, independent_cooperative); },
  };
}

Method dag_one_worker_preemptive() {
  return Method{
      .name = "dag_one_worker_preemptive",
      .subject = Subject::Dag,
      .cite = "as rta_preemptive, with C = volume of the DAG (docs/analysis.md, \"One worker\")",
      .assumptions =
          "one worker, full preemption, static priorities; R <= T for DAGs; timers that keep their periods where edges "
          "join rates; jitter, groups with inheritance, shared levels, max_active",
      .complexity = "pseudo-polynomial; O(n) per step",
      .knows_waits = true,
      .apply = [](const TaskSet &task_set) { return across_rates(task_set, dags_full); },
  };
}

Method dag_one_worker_deferred() {
  return Method{
      .name = "dag_one_worker_deferred",
      .subject = Subject::Dag,
      .cite = "as rta_deferred, with C = volume of the DAG (docs/analysis.md, \"One worker\")",
      .assumptions =
          "one worker, jobs run to completion or to a preemption point, static priorities; R <= T for DAGs; timers "
          "that "
          "keep their periods where edges join rates; jitter, max_active; groups unless cooperative",
      .complexity = "pseudo-polynomial; O(n) per step, all jobs of the busy period",
      .apply = [](const TaskSet &task_set) { return across_rates(task_set, dags_deferred); },
  };
}

}  // namespace redag::analysis
