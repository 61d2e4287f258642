// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/many_workers/suspension_aware.hpp"

#include <utility>
#include <vector>

#include "redag_analysis/core/rate_edges.hpp"
#include "redag_analysis/many_workers/contention.hpp"
#include "redag_analysis/many_workers/fixed_point.hpp"

namespace redag::analysis {
namespace {

using global::Contention;
using global::GlobalUnit;

// The units of a task set that the bounds accept.
global::Units units_that_wait(const TaskSet &task_set, bool any_policy) {
  global::Units view;
  if (!task_set.has_waits) {
    view.reason = "no task waits: see the other bounds";
    return view;
  }
  const auto mode = task_set.mode == sched::Preemption::None ? sched::Preemption::None : sched::Preemption::Full;
  return global::units_of(task_set, {.mode = mode, .bounds = true, .equals = true, .any_policy = any_policy});
}

// Sets a response at or below any that is found.
void start_with_path(GlobalUnit &unit) { unit.response = unit.length + unit.jitter; }

Outcome bound_in_order(const TaskSet &task_set) {
  global::Units view = units_that_wait(task_set, false);
  if (view.reason) return NotApplicable{*view.reason};
  Contention contention(task_set, view.units, view.workers);
  if (contention.why_not()) return NotApplicable{*contention.why_not()};
  return global::from_most_urgent(
      task_set, view.units, start_with_path,
      [&](std::size_t k, bool alone) {
        return contention.respond(k, alone ? 0 : view.units[k].response - view.units[k].jitter);
      },
      [&](std::size_t k) { return contention.explain(k); },
      [&](GlobalUnit &unit, const global::Part *part) { contention.narrow(unit, part); }, true);
}

Outcome bound_in_any_order(const TaskSet &task_set) {
  global::Units view = units_that_wait(task_set, true);
  if (view.reason) return NotApplicable{*view.reason};
  std::vector<GlobalUnit> &units = view.units;
  Contention contention(task_set, units, view.workers);
  if (contention.why_not()) return NotApplicable{*contention.why_not()};
  for (GlobalUnit &unit : units) start_with_path(unit);
  // The last unit is below all others.
  const auto as_last = [&units](std::size_t k, auto f) {
    std::swap(units[k], units.back());
    auto result = f(units.size() - 1);
    std::swap(units[k], units.back());
    return result;
  };
  return global::all_that_agree(
      task_set, units, "a DAG's response time can reach its next release, and then no other bound holds",
      [&](std::size_t k) {
        return as_last(
            k, [&](std::size_t last) { return contention.respond(last, units[last].response - units[last].jitter); });
      },
      [&](std::size_t k) { return as_last(k, [&](std::size_t last) { return contention.explain(last); }); });
}

}  // namespace

Method suspension_aware() {
  return Method{
      .name = "suspension_aware",
      .subject = Subject::Dag,
      .cite =
          "docs/analysis.md, \"Waits on any number of workers\"; after M. Bertogna, M. Cirinei, RTSS 2007, A. Melani "
          "et al., ECRTS 2015, and W.-H. Huang, J.-J. Chen, H. Zhou, C. Liu, PASS: priority assignment of real-time "
          "tasks with dynamic suspending behavior under fixed-priority scheduling, DAC 2015",
      .assumptions =
          "tasks that wait, m workers, full preemption or none, static priorities that keep DAGs together, one rate "
          "per "
          "DAG, R <= T; release jitter, equal priorities, max_active of DAGs in one part, devices of either queue; no "
          "shared groups",
      .complexity = "pseudo-polynomial; O(DAGs * devices) per step",
      .knows_waits = true,
      .apply = [](const TaskSet &task_set) { return across_rates(task_set, bound_in_order); },
  };
}

Method suspension_aware_any() {
  return Method{
      .name = "suspension_aware_any",
      .subject = Subject::Dag,
      .cite =
          "docs/analysis.md, \"Waits on any number of workers\"; after M. Bertogna, M. Cirinei, RTSS 2007, and A. "
          "Melani et al., ECRTS 2015 (global EDF)",
      .assumptions =
          "tasks that wait, m workers, full preemption or none, any work-conserving order (EDF, FIFO, interleaved "
          "priorities), one rate per DAG, R <= T for all; release jitter, max_active of DAGs in one part, devices of "
          "either queue; no shared groups",
      .complexity = "pseudo-polynomial; O(DAGs^2 * devices) per step, at most 1000 rounds",
      .knows_waits = true,
      .apply = bound_in_any_order,
  };
}

}  // namespace redag::analysis
