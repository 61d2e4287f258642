// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/one_worker/amc.hpp"

#include <algorithm>

#include "redag_analysis/core/arithmetic.hpp"
#include "redag_analysis/core/effort.hpp"
#include "redag_analysis/one_worker/one_worker.hpp"

namespace redag::analysis {
namespace {

using one_worker::FixedPoint;
using one_worker::Interferer;
using one_worker::Own;

constexpr std::string_view kOnlyInLowMode = "HI mode degrades this DAG: it is bounded in LO mode only";

// True if HI mode can end between the releases of one instance whose first jobs were skipped. The jobs that wait for
// those are then late, or skipped, in LO mode.
bool can_be_torn(const TaskSet &task_set) {
  return std::any_of(task_set.units.begin(), task_set.units.end(), [&](const Unit &unit) {
    return unit.tasks.size() > 1 && unit.jitter > 0 && !task_set.dags[unit.dag.value].high;
  });
}

std::optional<std::string> why_not_amc(const TaskSet &task_set) {
  if (!task_set.has_modes) return "no task has a wcet_low below its wcet, so there is no HI mode";
  if (auto reason = one_worker::why_not(task_set)) return reason;
  if (task_set.mode != sched::Preemption::Full) {
    return "requires full preemption, because jobs of lower criticality keep the worker in HI mode otherwise";
  }
  if (task_set.has_rate_edges()) return "edges join tasks of different rates";
  if (can_be_torn(task_set))
    return "a DAG of lower criticality has jitter, so HI mode can end between the releases of one instance";
  if (task_set.threads_suffice_if_bounded)
    return "there are fewer threads than tasks: a demoted job may hold the last one";
  if (!task_set.groups.empty())
    return "with groups, a job of lower criticality that holds one continues to run in HI mode";
  if (task_set.frozen > 0) return "stalls of the machine can begin or prolong HI mode";
  if (task_set.platform.preempt_overhead > 0)
    return "an overhead of preemption is not supported, because the change of mode also preempts";
  return std::nullopt;
}

// The time that a unit executes in LO mode.
Duration low_volume(const TaskSet &task_set, const Unit &unit) {
  Duration sum = 0;
  for (const std::uint32_t t : unit.tasks) sum = add(sum, task_set.tasks[t].wcet_low);
  return sum;
}

// One job of the unit in the busy period: R <= T.
Own own_of(const Unit &unit, Duration volume, Duration blocking) {
  return Own{volume, unit.period, unit.jitter, std::min(unit.limit, unit.period), blocking};
}

// The units that are more urgent than a unit, in each mode.
struct Others {
  std::vector<Interferer> low;       // all of them, with C(LO)
  std::vector<Interferer> high;      // those that HI mode does not stop, with C(HI)
  std::vector<std::uint32_t> units;  // of `low`
};

// True if HI mode lasts from its beginning to the end of each busy period, so that lower criticality only interferes
// before. The executor of the unit can be idle, and so end its HI mode, while jobs of others keep the processor busy.
bool is_stopped(const TaskSet &task_set, const Unit &unit) {
  return !task_set.has_separate_modes && !task_set.dags[unit.dag.value].high;
}

Others others_of(const TaskSet &task_set, const std::vector<std::uint32_t> &more_urgent) {
  Others others;
  Effort::spend(more_urgent.size());
  for (const std::uint32_t u : more_urgent) {
    const Unit &unit = task_set.units[u];
    others.units.push_back(u);
    others.low.push_back(Interferer{low_volume(task_set, unit), unit.period, unit.jitter});
    if (!is_stopped(task_set, unit)) others.high.push_back(Interferer{unit.volume, unit.period, unit.jitter});
  }
  return others;
}

// Lists the terms of the bound across the change. Lower criticality interferes only until HI mode begins.
std::vector<Term> terms_of(const TaskSet &task_set, const Unit &unit, const std::vector<one_worker::Blocker> &blockers,
                           const Others &others, Duration low_window, Duration window) {
  const TaskId self = unit.tasks.size() == 1 ? TaskId(unit.tasks.front()) : TaskId();
  std::vector<Term> terms = {Term{Term::Kind::Own, self, unit.dag, unit.volume, 1}};
  for (const one_worker::Blocker &blocker : blockers) {
    const TaskId task(blocker.task);
    terms.push_back(Term{Term::Kind::Blocking, task, task_set.tasks[blocker.task].dag, blocker.amount, 1});
  }
  for (std::size_t i = 0; i < others.units.size(); ++i) {
    const Unit &other = task_set.units[others.units[i]];
    const Duration interferes = is_stopped(task_set, other) ? low_window : window;
    const std::int64_t jobs = one_worker::jobs_in(others.low[i], interferes, false);
    const TaskId task = other.tasks.size() == 1 ? TaskId(other.tasks.front()) : TaskId();
    terms.push_back(Term{Term::Kind::Interference, task, other.dag, jobs * other.volume, jobs});
  }
  if (unit.jitter > 0) terms.push_back(Term{Term::Kind::Jitter, self, unit.dag, unit.jitter, 0});
  return terms;
}

// HI mode begins at most R(LO) after the start of a busy period in which the unit has a job; in LO mode the period
// would be over by then. Lower criticality thus contributes only the releases within R(LO).
void bound_unit(const TaskSet &task_set, const one_worker::Views &views, std::uint32_t u, ResponseBound &bound,
                ModeResponses &modes) {
  const Unit &unit = task_set.units[u];
  const std::vector<one_worker::Blocker> blockers = views.blockers(u);
  Duration blocking = 0;
  for (const one_worker::Blocker &blocker : blockers) blocking = add(blocking, blocker.amount);
  const Others others = others_of(task_set, views.more_urgent(u));

  const FixedPoint low =
      one_worker::preemptive_response(own_of(unit, low_volume(task_set, unit), blocking), others.low);
  bound.absent = task_set.dags[unit.dag.value].high ? low.absent : kOnlyInLowMode;
  if (!low.found) return;
  modes.low = low.found->response;
  if (!task_set.dags[unit.dag.value].high) return;

  const FixedPoint high = one_worker::preemptive_response(own_of(unit, unit.volume, blocking), others.high);
  if (high.found) modes.high = high.found->response;

  Duration before_change = blocking;
  for (std::size_t i = 0; i < others.units.size(); ++i) {
    const Unit &other = task_set.units[others.units[i]];
    if (!is_stopped(task_set, other)) continue;
    const std::int64_t jobs = one_worker::jobs_in(others.low[i], low.found->window, false);
    before_change = add(before_change, multiply(jobs, other.volume));
  }
  const FixedPoint change = one_worker::preemptive_response(own_of(unit, unit.volume, before_change), others.high);
  bound.absent = change.absent;
  if (!change.found) return;
  modes.change = change.found->response;
  bound.response = change.found->response;
  if (Effort::itemises(u))
    bound.terms = terms_of(task_set, unit, blockers, others, low.found->window, change.found->window);
}

Outcome apply_amc(const TaskSet &task_set) {
  if (auto reason = why_not_amc(task_set)) return NotApplicable{*reason};
  std::vector<ResponseBound> units(task_set.units.size());
  std::vector<ModeResponses> modes(task_set.units.size());
  bool low_is_met = true;
  bool high_is_met = true;
  const one_worker::Views views(task_set);
  for (std::uint32_t u = 0; u < units.size(); ++u) {
    bound_unit(task_set, views, u, units[u], modes[u]);
    const Duration deadline = std::min(task_set.units[u].deadline, task_set.units[u].limit);
    low_is_met = low_is_met && modes[u].low.value_or(kNever) <= deadline;
    if (task_set.dags[task_set.units[u].dag.value].high) {
      high_is_met = high_is_met && units[u].response.value_or(kNever) <= deadline;
    }
  }
  Bound bound = from_units(task_set, std::move(units));
  for (const CompiledTask &task : task_set.tasks) bound.modes.push_back(modes[task.unit]);
  bound.figures =
      std::string("in LO mode, ") + (low_is_met ? "every deadline is met" : "not every deadline is shown to be met") +
      "; deadlines of high criticality are " + (high_is_met ? "" : "not all shown to be ") + "met in every mode";
  return bound;
}

}  // namespace

Method amc_rtb() {
  return Method{
      .name = "amc_rtb",
      .subject = Subject::Task,
      .cite =
          "S. Baruah, A. Burns, R. Davis, Response-time analysis for mixed criticality systems, RTSS 2011 (AMC-rtb)",
      .assumptions =
          "one worker, full preemption, static priorities, some wcet_low below its wcet, no groups, R <= T; any "
          "degrade; "
          "DAGs of one rate as in rta_preemptive, without jitter if of lower criticality; shared levels; of "
          "several executors, HI mode of one is none of the others",
      .complexity = "pseudo-polynomial; O(n) per step",
      .knows_modes = true,
      .apply = apply_amc,
  };
}

}  // namespace redag::analysis
