// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/one_worker/response_time.hpp"

#include "redag_analysis/core/rate_edges.hpp"
#include "redag_analysis/one_worker/one_worker.hpp"
#include "redag_analysis/one_worker/task_bounds.hpp"

namespace redag::analysis {
namespace {

Outcome apply_in(sched::Preemption mode, const TaskSet &task_set) {
  if (auto reason = one_worker::why_not(task_set)) return NotApplicable{*reason};
  if (task_set.mode == mode) return one_worker::bound_tasks(task_set, mode != sched::Preemption::Full);
  switch (mode) {
    case sched::Preemption::None:
      return NotApplicable{"requires jobs that run to completion, but jobs can be preempted here"};
    case sched::Preemption::Cooperative: return NotApplicable{"requires cooperative jobs with preemption points"};
    case sched::Preemption::Full: break;
  }
  return NotApplicable{
      "requires full preemption, but jobs keep the worker here until they end or reach a preemption point"};
}

template <sched::Preemption kMode>
Outcome apply(const TaskSet &task_set) {
  return across_rates(task_set, [](const TaskSet &alone) { return apply_in(kMode, alone); });
}

}  // namespace

Method rta_preemptive() {
  return Method{
      .name = "rta_preemptive",
      .subject = Subject::Task,
      .cite =
          "M. Joseph, P. Pandya, Finding response times in a real-time system, The Computer Journal 29(5), 1986; K. "
          "Tindell, A. Burns, A. Wellings, An extendible approach for analysing fixed priority hard real-time tasks, "
          "Real-Time Systems 6(2), 1994; DAGs: docs/analysis.md, \"One worker\"",
      .assumptions =
          "one worker, full preemption, static priorities; any deadlines, but R <= T for DAGs; timers that keep their "
          "periods where edges join rates; release jitter, shared groups with priority inheritance, shared levels, "
          "max_active",
      .complexity = "pseudo-polynomial; O(n) per step",
      .knows_waits = true,
      .apply = apply<sched::Preemption::Full>,
  };
}

Method rta_nonpreemptive() {
  return Method{
      .name = "rta_nonpreemptive",
      .subject = Subject::Task,
      .cite =
          "R. Davis, A. Burns, R. Bril, J. Lukkien, Controller Area Network (CAN) schedulability analysis: Refuted, "
          "revisited and revised, Real-Time Systems 35(3), 2007; DAGs: docs/analysis.md, \"One worker\"",
      .assumptions =
          "one worker, jobs run to completion, static priorities; any deadlines, but R <= T for DAGs; timers that keep "
          "their periods where edges join rates; release jitter, groups, max_active",
      .complexity = "pseudo-polynomial; O(n) per step, all jobs of the busy period",
      .apply = apply<sched::Preemption::None>,
  };
}

Method rta_deferred() {
  return Method{
      .name = "rta_deferred",
      .subject = Subject::Task,
      .cite =
          "R. Bril, J. Lukkien, W. Verhaegh, Worst-case response time analysis of real-time tasks under fixed-priority "
          "scheduling with deferred preemption, Real-Time Systems 42, 2009; DAGs: docs/analysis.md, \"One worker\"",
      .assumptions = "as rta_nonpreemptive, with preemption points every `region`; shared levels; no shared groups",
      .complexity = "pseudo-polynomial; O(n) per step, all jobs of the busy period",
      .apply = apply<sched::Preemption::Cooperative>,
  };
}

}  // namespace redag::analysis
