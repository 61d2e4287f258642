// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/one_worker/offsets.hpp"

#include <algorithm>
#include <map>
#include <numeric>
#include <set>
#include <utility>
#include <vector>

#include "redag/base/int128.hpp"
#include "redag_analysis/core/arithmetic.hpp"
#include "redag_analysis/core/rate_edges.hpp"
#include "redag_analysis/one_worker/one_worker.hpp"
#include "redag_analysis/one_worker/task_bounds.hpp"

namespace redag::analysis {
namespace {

constexpr Duration kMostInstants = 2000;        // of one cycle
constexpr std::size_t kMostVisits = 2'000'000;  // of units, at all instants; the last DAGs keep their other bounds

using Units = std::vector<std::uint32_t>;

// The timers of one DAG and one clock, if they are not all released together. A task that waits for less urgent ones
// can be ready long after its release, and so counts as often as it can.
std::vector<Units> with_offsets(const TaskSet &task_set) {
  std::vector<Units> found;
  for (const CompiledDag &dag : task_set.dags) {
    std::map<std::uint32_t, Units> by_clock;
    for (const std::uint32_t u : dag.units) {
      const Unit &unit = task_set.units[u];
      if (unit.keeps_grid) by_clock[task_set.tasks[unit.tasks.front()].clock].push_back(u);
    }
    for (auto &[clock, units] : by_clock) {
      const Duration first = task_set.units[units.front()].offset;
      const auto differs = [&](std::uint32_t u) { return task_set.units[u].offset != first; };
      if (std::any_of(units.begin(), units.end(), differs)) found.push_back(std::move(units));
    }
  }
  return found;
}

// Where a busy period can begin: as a release is seen at the latest. Empty: there are too many such instants.
std::set<Duration> instants_of(const TaskSet &task_set, const Units &units) {
  Int128 cycle = 1;
  for (const std::uint32_t u : units) {
    const Duration period = task_set.units[u].period;
    cycle = cycle / std::gcd(static_cast<Duration>(cycle), period) * period;
    if (cycle > std::min(kMostInstants * Int128{period}, Int128{kUnbounded})) return {};
  }
  std::set<Duration> instants;
  for (const std::uint32_t u : units) {
    const Unit &unit = task_set.units[u];
    for (Int128 point = 0; point < cycle; point += unit.period) {
      instants.insert(static_cast<Duration>((point + unit.offset + unit.jitter) % cycle));
      if (instants.size() > kMostInstants) return {};
    }
  }
  return instants;
}

// A bound holds if it does wherever the busy period begins.
void keep_longest(ResponseBound &longest, ResponseBound found) {
  if (!longest.response) return;
  found.from_ready = std::max(found.from_ready, longest.from_ready);
  if (!found.response || *found.response > *longest.response) {
    longest = std::move(found);
  } else {
    longest.from_ready = found.from_ready;
  }
}

Outcome apply_offsets(const TaskSet &task_set) {
  if (auto reason = one_worker::why_not(task_set)) return NotApplicable{*reason};
  const bool is_deferred = task_set.mode != sched::Preemption::Full;
  if (is_deferred && task_set.has_waits) return NotApplicable{"jobs wait without a worker, and are not preempted"};
  if (task_set.platform.stall != Loss{} || task_set.platform.timer_overhead > 0) {
    return NotApplicable{"while a processor is taken away, releases of different timers move against each other"};
  }
  const std::vector<Units> dags = with_offsets(task_set);
  if (dags.empty()) return NotApplicable{"no DAG has timers of different offsets"};
  std::vector<ResponseBound> tasks = one_worker::bound_tasks(task_set, is_deferred).tasks;
  std::size_t visits = 0;
  for (const Units &units : dags) {
    TaskSet at = task_set;
    std::vector<ResponseBound> longest(tasks.size());
    for (ResponseBound &bound : longest) bound.response = 0;
    const std::set<Duration> instants = instants_of(task_set, units);
    visits += instants.size() * task_set.units.size();
    if (visits > kMostVisits) break;
    for (const Duration instant : instants) {
      for (const std::uint32_t u : units) {
        Unit &unit = at.units[u];
        const Duration since = (instant - unit.offset - unit.jitter) % unit.period;
        unit.phase = since > 0 ? unit.period - since : -since;
      }
      Bound found = one_worker::bound_tasks(at, is_deferred, units);
      for (std::size_t t = 0; t < tasks.size(); ++t) keep_longest(longest[t], std::move(found.tasks[t]));
    }
    for (std::size_t t = 0; t < tasks.size(); ++t) {
      if (longest[t].response.value_or(0) > 0) tasks[t] = std::move(longest[t]);
    }
  }
  return from_tasks(task_set, std::move(tasks));
}

}  // namespace

Method offsets() {
  return Method{
      .name = "offsets",
      .subject = Subject::Task,
      .cite =
          "K. Tindell, Adding time-offsets to schedulability analysis, University of York YCS 221, 1994; J. Palencia, "
          "M. Gonzalez Harbour, Schedulability analysis for tasks with static and dynamic offsets, RTSS 1998; "
          "docs/analysis.md, \"Offsets\"",
      .assumptions =
          "one worker, static priorities, as the rta_* methods; timers of one DAG and clock keep "
          "their periods and offsets; no stalls",
      .complexity = "pseudo-polynomial; the releases of one cycle of the DAG's timers times O(n) per step",
      .knows_waits = true,
      .apply = [](const TaskSet &task_set) { return across_rates(task_set, apply_offsets); },
  };
}

}  // namespace redag::analysis
