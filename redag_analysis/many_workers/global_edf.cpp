// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/many_workers/global_edf.hpp"

#include <algorithm>
#include <cstdio>

#include "redag_analysis/core/arithmetic.hpp"
#include "redag_analysis/core/effort.hpp"
#include "redag_analysis/many_workers/fixed_point.hpp"
#include "redag_analysis/many_workers/global_sequential.hpp"
#include "redag_analysis/many_workers/waiting_window.hpp"

namespace redag::analysis {
namespace {

using global::Division;
using global::GlobalUnit;
using global::Largest;

Duration deadline_of(const TaskSet &task_set, const GlobalUnit &unit) {
  return task_set.tasks[task_set.units[unit.unit].tasks.front()].deadline;
}

// The work after a job's release by jobs of `task` whose deadlines are `later` or more before that job's deadline. The
// last of them has exactly that deadline, and all execute as late as they can.
Duration due_work(const GlobalUnit &task, Duration later) {
  const Division jobs = global::divide(std::max<Duration>(0, later + task.response), task);
  return jobs.quotient * task.volume + std::min(task.volume, jobs.remainder);
}

// The tasks and what is assumed of them, one job at a time.
class Edf {
 public:
  Edf(const TaskSet &task_set, std::vector<GlobalUnit> &units) : task_set_(task_set), units_(units) {
    for (const GlobalUnit &unit : units_) deadlines_.push_back(deadline_of(task_set, unit));
    for (GlobalUnit &unit : units_) unit.response = unit.volume + unit.jitter;
  }

  bool respond(std::size_t k) {
    GlobalUnit &own = units_[k];
    global::FirstWindow first(task_set_.platform.workers, 0);
    for (std::size_t i = 0; i < units_.size(); ++i) {
      if (i != k) first.add(std::min(units_[i].volume, due_work(units_[i], later(k, i))));
    }
    Duration d = first.length();
    const bool found = global::least_fixed_point(own.limit - own.jitter - own.volume + 1, d,
                                                 [&](Duration waiting) { return window(k, waiting); });
    own.response = d - 1 + own.volume + own.jitter;
    return found;
  }

  // Called once all responses agree.
  ResponseBound explain(std::size_t k) {
    if (!Effort::itemises(units_[k].unit)) {
      ResponseBound bound;
      bound.response = units_[k].response;
      return bound;
    }
    (void)respond(k);
    const GlobalUnit &own = units_[k];
    const Duration waiting = own.response - own.jitter - own.volume + 1;
    ResponseBound bound;
    bound.response = own.response;
    global::SharedTerms terms(task_set_, own);
    terms.add_path();
    terms.add_jitter();
    for (std::size_t i = 0; i < units_.size(); ++i) {
      if (i == k) continue;
      const auto kind = units_[i].work > units_[i].carried ? Term::Kind::Blocking : Term::Kind::Interference;
      terms.add_share(kind, units_[i], std::min(units_[i].work, waiting), task_set_.platform.workers);
    }
    bound.terms = terms.take();
    // With very many workers the fixed point need not be the least one.
    Duration sum = 0;
    for (const Term &term : bound.terms) sum += term.amount;
    if (sum < own.response) {
      bound.terms.push_back(Term{Term::Kind::Interference, TaskId(), DagId(), own.response - sum, 0});
    }
    return bound;
  }

 private:
  // How much later the deadline of units_[k] is than that of units_[i]. Values above its own period are cut: the window
  // is not longer than the period.
  [[nodiscard]] Duration later(std::size_t k, std::size_t i) const {
    return std::min(deadlines_[k] - deadlines_[i], units_[k].period);
  }

  // Applies least_window() to all others. Leaves each one's work in `work`, and in `carried` the part with a deadline
  // in time.
  Duration window(std::size_t k, Duration d) {
    Effort::spend(units_.size());
    const bool preempts = task_set_.mode == sched::Preemption::Full;
    const GlobalUnit &own = units_[k];
    const std::uint32_t workers = task_set_.platform.workers;
    // A preemptable job waits in d instants before it has executed for C - 1; any other job waits before it starts.
    const Duration length = preempts ? d + own.volume - 1 : d;
    Largest blockers(preempts ? 0 : workers);
    for (std::size_t i = 0; i < units_.size(); ++i) {
      GlobalUnit &other = units_[i];
      if (i == k) continue;
      const Duration any = global::sequential_work(other, length);
      other.work = other.carried = std::min(any, due_work(other, later(k, i)));
      // The additional work of a job that had started, with a later deadline. If jobs of its task are due in time, it
      // adds no more than these leave.
      blockers.offer(std::min({any, other.volume - 1, d}) - std::min(other.carried, d), i);
    }
    for (const Largest::Entry &entry : blockers.entries()) {
      if (entry.value > 0) units_[entry.whose].work = units_[entry.whose].volume - 1;
    }
    Largest largest(workers - 1);
    Duration sum = 0;
    for (std::size_t i = 0; i < units_.size(); ++i) {
      if (i == k) continue;
      sum += units_[i].work;
      if (units_[i].work >= d) largest.offer(units_[i].work);
    }
    return global::least_window(sum, largest.entries(), workers);
  }

  const TaskSet &task_set_;
  std::vector<GlobalUnit> &units_;
  std::vector<Duration> deadlines_;
};

global::Units edf_units(const TaskSet &task_set, sched::Preemption mode) {
  global::Units view = global::units_of(task_set, {.mode = mode, .edges = false, .any_policy = true});
  if (task_set.policy != PolicyKind::Edf) {
    view.reason = std::string("requires edf, but the policy is ") + to_string(task_set.policy);
  } else if (!view.reason && mode == sched::Preemption::None && view.workers > Largest::kMost) {
    view.reason = "supports at most " + std::to_string(Largest::kMost) + " workers where jobs run to completion";
  }
  return view;
}

Outcome apply_response(const TaskSet &task_set) {
  const auto mode = task_set.mode == sched::Preemption::None ? sched::Preemption::None : sched::Preemption::Full;
  global::Units view = edf_units(task_set, mode);
  if (view.reason) return NotApplicable{*view.reason};
  Edf edf(task_set, view.units);
  return global::all_that_agree(
      task_set, view.units, "a task's response time can reach its next release, and then no other bound holds",
      [&](std::size_t k) { return edf.respond(k); }, [&](std::size_t k) { return edf.explain(k); });
}

// Densities in units of 2^-40, rounded up.
constexpr Int128 kDensityUnit = Int128{1} << 40;

double density_as_double(Int128 value) { return static_cast<double>(value) / static_cast<double>(kDensityUnit); }

Outcome apply_density(const TaskSet &task_set) {
  const global::Units view = edf_units(task_set, sched::Preemption::Full);
  if (view.reason) return NotApplicable{*view.reason};
  Int128 sum = 0;
  Int128 largest = 0;
  for (const GlobalUnit &unit : view.units) {
    const CompiledTask &task = task_set.tasks[task_set.units[unit.unit].tasks.front()];
    if (task.deadline > unit.limit) return NotApplicable{"task '" + task.name + "': its deadline exceeds its period"};
    if (task.deadline <= task.jitter) {
      return NotApplicable{"task '" + task.name + "': its jitter is not below its deadline"};
    }
    const Duration end_to_end = task_set.dags[task.dag.value].deadline;
    if (end_to_end > 0 && end_to_end < task.deadline) {
      return NotApplicable{"DAG '" + task_set.dags[task.dag.value].name +
                           "': its deadline is below those of its tasks"};
    }
    const Duration until = task.deadline - task.jitter;
    const Int128 density = (unit.volume * kDensityUnit + until - 1) / until;
    sum += density;
    largest = std::max(largest, density);
  }
  const Int128 m = view.workers;
  const Int128 limit = m * kDensityUnit - (m - 1) * largest;
  Bound bound;
  bound.accepts = largest <= kDensityUnit && sum <= limit;
  char text[96];
  std::snprintf(text, sizeof text, "density = %.4f, limit %.4f", density_as_double(sum), density_as_double(limit));
  bound.figures = text;
  return bound;
}

}  // namespace

Method edf_global_density() {
  return Method{
      .name = "edf_global_density",
      .subject = Subject::TaskSet,
      .cite =
          "J. Goossens, S. Funk, S. Baruah, Priority-driven scheduling of periodic task systems on multiprocessors, "
          "Real-Time Systems 25, 2003; M. Bertogna, M. Cirinei, G. Lipari, Improved schedulability analysis of EDF on "
          "multiprocessor platforms, ECRTS 2005",
      .assumptions =
          "m workers, full preemption, edf, no edges, D <= T and no jobs skipped before it, jitter below the deadline; "
          "no shared groups, no max_active",
      .complexity = "O(n)",
      .apply = apply_density,
  };
}

Method edf_global_response() {
  return Method{
      .name = "edf_global_response",
      .cite =
          "M. Bertogna, M. Cirinei, Response-time analysis for globally scheduled symmetric multiprocessor platforms, "
          "RTSS 2007; without preemption: docs/analysis.md, \"EDF on several workers\"",
      .assumptions =
          "m workers, full preemption or none, edf, no edges, R <= T for all tasks; release jitter; no shared groups, "
          "no "
          "max_active",
      .complexity = "pseudo-polynomial; O(n^2) per step, at most 1000 rounds",
      .apply = apply_response,
  };
}

}  // namespace redag::analysis
