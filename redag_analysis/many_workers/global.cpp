// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/many_workers/global.hpp"

#include <algorithm>
#include <iterator>
#include <map>
#include <numeric>
#include <set>

#include "redag/sched/policy.hpp"
#include "redag_analysis/core/arithmetic.hpp"
#include "redag_analysis/core/effort.hpp"
#include "redag_analysis/core/jobs_in_progress.hpp"
#include "redag_analysis/core/rate_edges.hpp"

namespace redag::analysis::global {
namespace {

std::optional<std::string> why_not_mode(const TaskSet &task_set, const Needs &needs) {
  if (!needs.any_policy && !is_static(task_set.policy)) {
    return std::string("requires static priorities, but the policy is ") + to_string(task_set.policy);
  }
  if (task_set.mode == needs.mode) return std::nullopt;
  return needs.mode == sched::Preemption::Full
             ? "requires full preemption, but jobs keep the worker here until they end or reach a preemption point"
             : "requires jobs that run to completion, but jobs can be preempted here";
}

// Instances of the unit overlap, and any of its tasks can execute beside any other.
void let_overlap(GlobalUnit &unit, std::uint32_t workers) {
  set_width(unit, std::min({workers, unit.tasks, unit.bound > 0 ? unit.bound : unit.tasks}));
}

// True if the max_active can bind while R <= T. One that the DAG's tasks reach only if its instances overlap cannot.
bool can_bind(const TaskSet &task_set, DagId id) {
  const CompiledDag &dag = task_set.dags[id.value];
  if (dag.max_active == 0) return false;
  return dag.units.size() > 1 || most_jobs_in_progress(task_set, id) > dag.max_active;
}

std::optional<std::string> why_not_structure(const TaskSet &task_set, const Needs &needs) {
  if (auto reason = why_not_directly(task_set)) return reason;
  if (!needs.edges && task_set.has_edges()) return "tasks have predecessors: see the bounds for DAGs";
  if (!needs.groups && !task_set.groups.empty()) return "with exclusive groups, a worker can be idle while a job waits";
  for (std::size_t d = 0; d < task_set.dags.size(); ++d) {
    const CompiledDag &dag = task_set.dags[d];
    if (!can_bind(task_set, DagId(d))) continue;
    if (!needs.bounds) return "DAG '" + dag.name + "' has a max_active, so a worker can be idle while a job waits";
    if (dag.units.size() > 1) return "DAG '" + dag.name + "': several of its parts share one max_active";
  }
  return std::nullopt;
}

// The place that two tasks share if either can go before the other: the level under full preemption, else the tier.
std::uint32_t shared_place(const TaskSet &task_set, std::uint32_t rank) {
  const CompiledTask &task = task_set.tasks[task_set.by_rank[rank]];
  return task_set.mode == sched::Preemption::Full ? task.level : task.tier;
}

bool are_equals(const TaskSet &task_set, const GlobalUnit &upper, const GlobalUnit &lower) {
  return shared_place(task_set, task_set.units[upper.unit].last_rank) >=
         shared_place(task_set, task_set.units[lower.unit].first_rank);
}

std::optional<std::string> why_not_order(const TaskSet &task_set, const std::vector<GlobalUnit> &units, bool equals) {
  for (std::size_t i = 0; i + 1 < units.size(); ++i) {
    const Unit &upper = task_set.units[units[i].unit];
    const Unit &lower = task_set.units[units[i + 1].unit];
    if (upper.last_rank > lower.first_rank) {
      return "priorities of '" + task_set.dags[upper.dag.value].name + "' and '" + task_set.dags[lower.dag.value].name +
             "' are interleaved";
    }
    if (!equals && are_equals(task_set, units[i], units[i + 1])) {
      return "'" + task_set.dags[upper.dag.value].name + "' and '" + task_set.dags[lower.dag.value].name +
             "' share a priority level, so either can run first";
    }
  }
  return std::nullopt;
}

// True if all times are small enough that no sum of workloads wraps and divide() is exact.
bool fits(const std::vector<GlobalUnit> &units, std::uint32_t workers) {
  Duration longest = 1;
  for (const GlobalUnit &unit : units) longest = std::max({longest, unit.period, ceil_div(unit.volume, workers)});
  const Int128 sum = Int128{longest} * 4 * workers * (static_cast<Duration>(units.size()) + 2);
  return Int128{longest} * workers < (Int128{1} << 50U) && sum < (Int128{1} << 62U);
}

// Measures the longest path through these tasks, which stand in topological order, and the most tasks on any path.
void measure_paths(const TaskSet &task_set, const std::vector<std::uint32_t> &tasks, GlobalUnit &result) {
  struct Path {
    Duration length = 0;
    Duration overhead = 0;
    std::uint32_t tasks = 0;
  };
  std::map<std::uint32_t, Path> paths;
  result.length = result.path_tasks = 0;
  for (const std::uint32_t t : tasks) {
    const CompiledTask &task = task_set.tasks[t];
    Path longest;
    std::uint32_t most = 0;
    for (const std::uint32_t p : task.predecessors) {
      const Path &before = paths[p];
      if (before.length > longest.length) longest = before;
      most = std::max(most, before.tasks);
    }
    const Path path{add(longest.length, task.wcet), add(longest.overhead, task.overhead), most + 1};
    if (path.length > result.length) {
      result.length = path.length;
      result.path_overhead = path.overhead;
    }
    result.path_tasks = std::max(result.path_tasks, path.tasks);
    paths[t] = path;
  }
}

}  // namespace

GlobalUnit unit_of(const TaskSet &task_set, std::uint32_t id) {
  const Unit &unit = task_set.units[id];
  const CompiledDag &dag = task_set.dags[unit.dag.value];
  const std::uint32_t workers = task_set.platform.workers;
  GlobalUnit result;
  result.unit = id;
  result.volume = unit.volume;
  result.period = unit.period;
  result.jitter = unit.jitter;
  result.limit = std::min(unit.limit, unit.period);
  result.tasks = static_cast<std::uint32_t>(unit.tasks.size());
  result.bound = dag.max_active > 0 && dag.max_active < result.tasks ? std::min(dag.max_active, workers) : 0;
  result.abreast = most_side_by_side(task_set, unit.tasks);
  set_width(result, std::min({workers, result.abreast, result.bound > 0 ? result.bound : result.abreast}));
  measure_paths(task_set, unit.tasks, result);
  return result;
}

Units units_of(const TaskSet &task_set, const Needs &needs) {
  Units result;
  result.workers = task_set.platform.workers;
  result.reason = why_not_mode(task_set, needs);
  if (!result.reason) result.reason = why_not_structure(task_set, needs);
  if (result.reason) return result;
  result.units.reserve(task_set.units.size());
  for (std::uint32_t u = 0; u < task_set.units.size(); ++u) {
    result.units.push_back(unit_of(task_set, u));
    GlobalUnit &unit = result.units.back();
    if (unit.bound > 0 && !can_bind(task_set, task_set.units[u].dag)) unit.bound = 0;
    if (needs.groups) let_overlap(unit, result.workers);
  }
  std::sort(result.units.begin(), result.units.end(), [&](const GlobalUnit &a, const GlobalUnit &b) {
    return task_set.units[a.unit].first_rank < task_set.units[b.unit].first_rank;
  });
  if (!needs.any_policy) result.reason = why_not_order(task_set, result.units, needs.equals);
  if (!result.reason && !fits(result.units, result.workers)) result.reason = "the times are too long for exact sums";
  return result;
}

Peers peers_of(const TaskSet &task_set, const std::vector<GlobalUnit> &units, std::size_t k) {
  Peers peers{k, k + 1};
  while (peers.begin > 0 && are_equals(task_set, units[peers.begin - 1], units[peers.begin])) --peers.begin;
  while (peers.end < units.size() && are_equals(task_set, units[peers.end - 1], units[peers.end])) ++peers.end;
  return peers;
}

// Of each task one job may have started, others are queued, and one waits for predecessors. A data task has no more
// releases than a predecessor has ends, and of those at most that number are of jobs from before the window.
bool assume_overlap(const TaskSet &task_set, GlobalUnit &unit) {
  const Unit &compiled = task_set.units[unit.unit];
  Duration unfinished = 0;
  for (const std::uint32_t t : compiled.tasks) {
    unfinished = add(unfinished, std::max<Duration>(1, task_set.tasks[t].limit / compiled.period) + 2);
  }
  // One more period for the division, and the volume, which dag_work() takes for done in time.
  unit.response = add(add(compiled.jitter, multiply(unit.period, unfinished + 1)), compiled.volume);
  constexpr Duration kLongest = Duration{1} << 44U;
  constexpr Duration kLargestLoad = 16;
  let_overlap(unit, task_set.platform.workers);
  const Duration width = task_set.platform.workers;
  return unit.response < kLongest / width && compiled.volume / compiled.period < kLargestLoad * width;
}

Part part_until(const TaskSet &task_set, std::uint32_t task) {
  const std::vector<std::uint32_t> &tasks = task_set.units[task_set.tasks[task].unit].tasks;
  Part part;
  std::set<std::uint32_t> after = {task};
  for (const std::uint32_t t : tasks) {
    const std::vector<std::uint32_t> &before = task_set.tasks[t].predecessors;
    const bool follows = std::any_of(before.begin(), before.end(), [&](std::uint32_t p) { return after.contains(p); });
    if (follows) after.insert(t);
    if (!follows) part.tasks.push_back(t);
  }
  std::set<std::uint32_t> leads = {task};
  for (std::size_t i = tasks.size(); i-- > 0;) {
    if (!leads.contains(tasks[i])) continue;
    leads.insert(task_set.tasks[tasks[i]].predecessors.begin(), task_set.tasks[tasks[i]].predecessors.end());
  }
  std::copy_if(tasks.begin(), tasks.end(), std::back_inserter(part.paths),
               [&](std::uint32_t t) { return leads.contains(t); });
  return part;
}

void narrow(const TaskSet &task_set, const Part &part, GlobalUnit &unit) {
  unit.volume = 0;
  for (const std::uint32_t t : part.tasks) unit.volume = add(unit.volume, task_set.tasks[t].wcet);
  unit.tasks = static_cast<std::uint32_t>(part.tasks.size());
  unit.abreast = std::min(unit.abreast, unit.tasks);
  measure_paths(task_set, part.paths, unit);
}

bool is_hopeless(const GlobalUnit &unit, std::uint32_t workers) {
  return unit.volume > multiply(unit.limit, workers) || unit.length > unit.limit;
}

bool is_any_hopeless(std::span<const GlobalUnit> units, std::uint32_t workers) {
  return std::any_of(units.begin(), units.end(), [&](const GlobalUnit &unit) { return is_hopeless(unit, workers); });
}

void set_width(GlobalUnit &unit, std::uint32_t width) {
  unit.width = width;
  unit.turn = multiply(unit.period, width);
  unit.rate = 1.0 / static_cast<double>(unit.turn);
}

SharedTerms::SharedTerms(const TaskSet &task_set, const GlobalUnit &unit)
    : task_set_(task_set), unit_(unit), wanted_(Effort::itemises(unit.unit)) {}

void SharedTerms::push(Term::Kind kind, const GlobalUnit &whose, Duration amount, std::int64_t jobs) {
  if (!wanted_) return;
  const Unit &unit = task_set_.units[whose.unit];
  const TaskId task = unit.tasks.size() == 1 ? TaskId(unit.tasks.front()) : TaskId();
  terms_.push_back(Term{kind, task, unit.dag, amount, jobs, device_});
}

void SharedTerms::add_path() {
  push(Term::Kind::Own, unit_, unit_.length - unit_.path_overhead, 1);
  if (unit_.path_overhead > 0) push(Term::Kind::Overhead, unit_, unit_.path_overhead, 0);
}

void SharedTerms::add_jitter() {
  if (unit_.jitter > 0) push(Term::Kind::Jitter, unit_, unit_.jitter, 0);
}

void SharedTerms::add(Term::Kind kind, const GlobalUnit &whose, Duration amount, std::int64_t jobs) {
  if (amount != 0) push(kind, whose, amount, jobs);
}

void SharedTerms::add(const Term &term) {
  if (wanted_ && term.amount != 0) terms_.push_back(term);
}

void SharedTerms::add_share(Term::Kind kind, const GlobalUnit &whose, Duration numerator, Duration denominator,
                            std::int64_t jobs) {
  const Duration whole = take_share(numerator, denominator);
  if (numerator != 0) push(kind, whose, whole, jobs);
}

void SharedTerms::add_blocking(Duration numerator, Duration denominator) {
  const Duration whole = take_share(numerator, denominator);
  if (wanted_ && numerator != 0) terms_.push_back(Term{Term::Kind::Blocking, {}, {}, whole, 0, device_});
}

Duration SharedTerms::take_share(Duration numerator, Duration denominator) {
  if (denominator_ == 1) denominator_ = denominator;  // no remainder so far
  if (denominator == denominator_) {
    const Duration sum = remainder_ + numerator;
    remainder_ = sum % denominator;
    return sum / denominator;
  }
  const Int128 common = Int128{denominator_} * denominator;
  const Int128 sum = Int128{remainder_} * denominator + Int128{numerator} * denominator_;
  const auto whole = static_cast<Duration>(sum / common);
  // The denominator stays small: at most a max_active and the number of workers meet.
  const auto rest = static_cast<Duration>(sum % common);
  const Duration divisor = std::gcd(rest, static_cast<Duration>(common));
  remainder_ = rest / divisor;
  denominator_ = static_cast<Duration>(common) / divisor;
  return whole;
}

Duration largest_remaining(const TaskSet &task_set, const std::vector<GlobalUnit> &units, std::size_t from,
                           std::uint32_t count) {
  std::vector<Duration> all;
  std::vector<Duration> own;
  Effort::spend(units.size() - from);
  for (std::size_t u = from; u < units.size(); ++u) {
    own.clear();
    for (const std::uint32_t t : task_set.units[units[u].unit].tasks) own.push_back(task_set.tasks[t].wcet - 1);
    std::sort(own.begin(), own.end(), std::greater<>());
    if (units[u].bound > 0) own.resize(std::min<std::size_t>(own.size(), units[u].bound));
    all.insert(all.end(), own.begin(), own.end());
  }
  std::sort(all.begin(), all.end(), std::greater<>());
  Duration sum = 0;
  for (std::size_t i = 0; i < all.size() && i < count; ++i) sum = add(sum, all[i]);
  return sum;
}

}  // namespace redag::analysis::global
