// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/any_features/by_demand.hpp"

#include <algorithm>
#include <utility>
#include <variant>
#include <vector>

#include "redag_analysis/any_features/demand.hpp"
#include "redag_analysis/core/arithmetic.hpp"
#include "redag_analysis/core/effort.hpp"
#include "redag_analysis/core/rate_edges.hpp"

namespace redag::analysis {
namespace any_features {
namespace {

constexpr std::string_view kDemandExceeds = "the demand of all that can go first exceeds the workers";
constexpr std::string_view kWaitsForData =
    "jobs of a predecessor can be lost, and nothing bounds the time until the next";
constexpr std::size_t kMostAcrossRates = 100;  // tasks; each round bounds all of them anew
constexpr std::uint64_t kMostStepsAcrossRates = 20'000'000;
constexpr std::string_view kLosesData = "a job of it can be lost, and its data with it";

class DemandBounds {
 public:
  explicit DemandBounds(const TaskSet &task_set)
      : task_set_(task_set),
        demand_(task_set),
        since_(demand_.since),
        bounds_(task_set.tasks.size()),
        ends_(task_set.tasks.size()),
        from_unit_(task_set.tasks.size()) {}

  /// A bound for each task: of all its jobs, or of those that end.
  Bound run() {
    find();
    return assemble();
  }

  /// From the nominal releases of units of which no job is lost; the others have none.
  Bound of_units_without_loss() {
    find();
    std::vector<ResponseBound> bounds(task_set_.tasks.size());
    for (std::uint32_t t = 0; t < bounds.size(); ++t) {
      bounds[t].response = from_unit_[t];
      if (!bounds[t].response) bounds[t].absent = since_[t] ? kLosesData : kDemandExceeds;
      if (bounds[t].response && Effort::itemises(task(t).unit))
        bounds[t].terms = terms_of(t, *from_unit_[t] - *since_[t]);
    }
    return from_tasks(task_set_, std::move(bounds));
  }

 private:
  void find() {
    // What is found of the more urgent tasks makes the others' bounds smaller.
    for (const int sweep : {0, 1}) {
      bool changed = false;
      for (const std::uint32_t t : task_set_.by_rank) {
        const std::optional<Duration> before = since_[t];
        bound(t);
        changed = changed || since_[t] != before;
      }
      find_readiness();
      if (sweep == 0 && (!changed || task_set_.platform.workers == 1)) break;
    }
    find_losses();
  }

  [[nodiscard]] const CompiledTask &task(std::uint32_t t) const { return task_set_.tasks[t]; }

  void bound(std::uint32_t t) {
    const auto take = [&](std::optional<Duration> found) {
      if (found && (!since_[t] || found < since_[t])) since_[t] = found;
    };
    for (const bool all : {false, true}) {
      if (all && since_[t]) return;
      take(window_of(demand_, t, all));
      if (task_set_.platform.workers == 1) take(busy_period_of(demand_, t, all));
    }
  }

  // Finds when jobs that end become ready, if something bounds it, and when they end: after the release of their unit.
  void find_readiness() {
    for (const Unit &unit : task_set_.units) {
      for (const std::uint32_t t : unit.tasks) {
        std::optional<Duration> ready = task(t).jitter;
        if (waits_for_data(task(t))) {
          ready = demand_.until[t] = until_ready(t);
        } else {
          for (const std::uint32_t p : task(t).predecessors) ready = later(ready, ends_[p]);
        }
        ends_[t] = ready && since_[t] ? std::optional(add(*ready, *since_[t])) : std::nullopt;
      }
    }
  }

  // Timers keep their periods where edges join rates: the next release that is not refused then ends the wait.
  // Otherwise all timers of the unit have the same releases.
  [[nodiscard]] std::optional<Duration> until_ready(std::uint32_t t) const {
    const std::vector<std::uint32_t> &units = task_set_.dags[task(t).dag.value].units;
    if (std::any_of(units.begin(), units.end(), [this](auto u) { return !task_set_.units[u].awaits.empty(); })) {
      return add(task(t).replaced, task(t).jitter);
    }
    // Data of the next release come too late if this job is skipped at that instant. Of a timer they never serve.
    const bool is_skipped_next = task(t).jitter == 0 && task(t).replaced == task(t).period;
    std::optional<Duration> ready = task(t).jitter;
    for (const std::uint32_t p : task(t).predecessors) {
      ready = later(ready, !task(p).data || is_skipped_next ? ends_[p] : std::nullopt);
    }
    return ready;
  }

  [[nodiscard]] static std::optional<Duration> later(std::optional<Duration> a, std::optional<Duration> b) {
    return a && b ? std::max(a, b) : std::nullopt;
  }

  // The bound of jobs that end, from the task's nominal release.
  [[nodiscard]] std::optional<Duration> from_release(std::uint32_t t) const {
    return task(t).data && since_[t] ? std::optional(add(*since_[t], task_set_.frozen)) : ends_[t];
  }

  // No job of a task is lost that ends before the next release of its unit, if its predecessors lose none.
  void find_losses() {
    for (const Unit &unit : task_set_.units) {
      for (const std::uint32_t t : unit.tasks) {
        const std::vector<std::uint32_t> &before = task(t).predecessors;
        Duration ready = task(t).jitter;
        for (const std::uint32_t p : before) ready = std::max(ready, from_unit_[p].value_or(kUnbounded));
        if (!since_[t] || task(t).can_lose || !unit.awaits.empty()) continue;
        if (const Duration end = add(ready, *since_[t]); end <= unit.limit) from_unit_[t] = end;
      }
    }
  }

  Bound assemble() {
    for (std::uint32_t t = 0; t < task_set_.tasks.size(); ++t) {
      ResponseBound &bound = bounds_[t];
      if (!since_[t]) {
        bound.absent = kDemandExceeds;
        continue;
      }
      bound.of_ended = !from_unit_[t];
      bound.response = task(t).data || bound.of_ended ? from_release(t) : from_unit_[t];
      if (!bound.response) bound.absent = kWaitsForData;
      if (bound.response && Effort::itemises(task(t).unit)) bound.terms = terms_of(t, *bound.response - *since_[t]);
    }
    Bound bound;
    for (ResponseBound &one : bounds_) bound.tasks.push_back(if_bounded(std::move(one)));
    for (const CompiledDag &dag : task_set_.dags) {
      ResponseBound whole;
      whole.response = 0;
      for (const std::uint32_t t : dag.tasks) {
        if (!whole.response || !from_unit_[t]) {
          whole = ResponseBound{};
          whole.absent = since_[t] ? kLosesData : kDemandExceeds;
        } else if (*from_unit_[t] >= *whole.response) {
          whole.response = *from_unit_[t];
          whole.terms = bound.tasks[t].terms;
          const Duration before = *from_unit_[t] - *bound.tasks[t].response;
          if (before != 0 && !whole.terms.empty()) {
            whole.terms.push_back(Term{Term::Kind::Wait, {}, task(t).dag, before, 0});
          }
        }
      }
      bound.dags.push_back(if_bounded(std::move(whole)));
    }
    return bound;
  }

  [[nodiscard]] std::vector<Term> terms_of(std::uint32_t t, Duration late) const {
    const Duration own = std::min(*since_[t], executes(task(t)) - task(t).overhead);
    const DagId dag = task(t).dag;
    std::vector<Term> terms = {Term{Term::Kind::Own, TaskId(t), dag, own, 1},
                               Term{Term::Kind::Interference, {}, {}, *since_[t] - own, 0}};
    if (late > 0)
      terms.push_back(Term{waits_for_data(task(t)) ? Term::Kind::Wait : Term::Kind::Jitter, {}, dag, late, 0});
    return terms;
  }

  const TaskSet &task_set_;
  Demand demand_;
  std::vector<std::optional<Duration>> &since_;  // Demand::since
  std::vector<ResponseBound> bounds_;
  std::vector<std::optional<Duration>> ends_;       // by TaskId: see find_readiness()
  std::vector<std::optional<Duration>> from_unit_;  // by TaskId: from its unit's nominal release to its end, of
                                                    // tasks that lose no job
};

// Bounds units apart from each other; what they wait for is jitter of the first task.
Outcome apply_to_units(const TaskSet &alone) {
  TaskSet late = alone;
  for (const Unit &unit : alone.units) {
    CompiledTask &first = late.tasks[unit.tasks.front()];
    first.jitter = std::max(first.jitter, unit.jitter);
  }
  return DemandBounds(late).of_units_without_loss();
}

// Where edges join rates, a unit of which no job is lost makes others wait a known time.
void extend_across_rates(const TaskSet &task_set, Bound &bound) {
  const std::uint32_t threads = task_set.platform.max_started;
  const bool are_threads_enough =
      task_set.mode != sched::Preemption::Full || threads == 0 || threads >= task_set.tasks.size();
  if (!task_set.has_rate_edges() || !are_threads_enough || task_set.tasks.size() > kMostAcrossRates) return;
  Effort::Limits limits;
  limits.steps = kMostStepsAcrossRates;
  const Effort effort(limits);
  Bound found;
  try {
    found = std::get<Bound>(across_rates(task_set, apply_to_units));
  } catch (const Effort::GaveUp &gave_up) {
    if (gave_up.scope != &effort) throw;
    return;
  }
  for (std::uint32_t t = 0; t < task_set.tasks.size(); ++t) {
    if (found.tasks[t].response && bound.tasks[t].of_ended) bound.tasks[t] = found.tasks[t];
  }
  for (std::uint32_t d = 0; d < task_set.dags.size(); ++d) {
    if (found.dags[d].response && !bound.dags[d].response) bound.dags[d] = found.dags[d];
  }
}

TaskSet with_time_behind(TaskSet task_set) {
  const auto lengthen = [&](Duration &time) { time = add(time, task_set.frozen_behind); };
  lengthen(task_set.frozen);
  for (CompiledTask &task : task_set.tasks) {
    if (!task.data) lengthen(task.jitter);
  }
  for (Unit &unit : task_set.units) {
    if (!task_set.tasks[unit.tasks.front()].data) lengthen(unit.jitter);
  }
  return task_set;
}

Outcome apply_by_demand(const TaskSet &compiled) {
  const TaskSet task_set = with_time_behind(compiled);
  if (!task_set.groups.empty() && task_set.several_executors) {
    return NotApplicable{"groups of several executors on one processor: a holder need not run for those that wait"};
  }
  Bound bound = DemandBounds(task_set).run();
  extend_across_rates(task_set, bound);
  return bound;
}

}  // namespace
}  // namespace any_features

Method by_demand() {
  return Method{
      .name = "by_demand",
      .subject = Subject::Task,
      .cite = "docs/analysis.md, \"Any features\"",
      .assumptions = "any workers, policy, preemption and features; groups only of one executor",
      .complexity = "pseudo-polynomial; O(tasks) per step, for each task",
      .knows_modes = true,
      .knows_waits = true,
      .knows_all = true,
      .apply = any_features::apply_by_demand,
  };
}

}  // namespace redag::analysis
