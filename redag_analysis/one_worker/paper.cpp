// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/one_worker/paper.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <map>
#include <span>
#include <utility>

#include "redag_analysis/core/arithmetic.hpp"
#include "redag_analysis/core/effort.hpp"
#include "redag_analysis/one_worker/one_worker.hpp"

namespace redag::analysis {
namespace {

constexpr int kMaxIterations = 1'000'000;

bool can_block(const TaskSet &task_set) {
  const one_worker::Views views(task_set);
  for (std::uint32_t u = 0; u < task_set.units.size(); ++u) {
    if (!views.blockers(u).empty()) return true;
  }
  return false;
}

// Returns the first assumption of the paper's equations that does not hold here; empty if all hold.
std::string broken_assumption(const TaskSet &task_set, bool with_blocking) {
  if (task_set.policy != PolicyKind::RateMonotonic) return "the policy is not rate_monotonic";
  if (auto reason = one_worker::why_not(task_set)) return *reason;
  if (task_set.has_edges()) return "callbacks have predecessors, and the time they wait for them is not counted";
  for (const CompiledTask &task : task_set.tasks) {
    if (task.jitter > 0) return "task '" + task.name + "' has release jitter";
  }
  for (std::size_t rank = 1; rank < task_set.by_rank.size(); ++rank) {
    const CompiledTask &task = task_set.tasks[task_set.by_rank[rank]];
    if (task.period == task_set.tasks[task_set.by_rank[rank - 1]].period) {
      return "task '" + task.name +
             "' has the same period as another one, and the equation counts neither for the other";
    }
  }
  if (with_blocking) return {};
  if (task_set.mode != sched::Preemption::Full) return "less urgent callbacks are not preempted at once";
  return can_block(task_set) ? "less urgent callbacks can block" : "";
}

// hp(i) of the paper: the tasks with strictly smaller periods.
std::vector<std::uint32_t> more_urgent(const TaskSet &task_set, const CompiledTask &task) {
  std::vector<std::uint32_t> found;
  for (std::uint32_t j = 0; j < task_set.tasks.size(); ++j) {
    if (task_set.tasks[j].period < task.period) found.push_back(j);
  }
  return found;
}

// The callbacks of one period together.
struct Rate {
  Duration period = 0;
  Duration wcet = 0;
};

std::vector<Rate> rates_of(const TaskSet &task_set) {
  std::map<Duration, Duration> wcets;
  for (const CompiledTask &task : task_set.tasks) wcets[task.period] = add(wcets[task.period], task.wcet);
  std::vector<Rate> rates;
  rates.reserve(wcets.size());
  for (const auto &[period, wcet] : wcets) rates.push_back({period, wcet});
  return rates;
}

// The rates of hp(i).
std::span<const Rate> more_urgent(std::span<const Rate> rates, const CompiledTask &task) {
  const auto end =
      std::partition_point(rates.begin(), rates.end(), [&](const Rate &rate) { return rate.period < task.period; });
  return rates.first(static_cast<std::size_t>(end - rates.begin()));
}

// R = start + sum ceil(R / T_j) C_j up to `limit`.
std::optional<Duration> recurrence(Duration start, std::span<const Rate> others, Duration limit) {
  Duration response = start;
  for (int step = 0; step < kMaxIterations && response <= limit; ++step) {
    Effort::spend(others.size() + 1);
    Int128 sum = start;
    for (const Rate &rate : others) sum += Int128{ceil_div(response, rate.period)} * rate.wcet;
    if (saturate(sum) == response) return response;
    response = saturate(sum);
  }
  return std::nullopt;
}

ResponseBound itemise(const TaskSet &task_set, std::uint32_t t, std::optional<Duration> response, bool once,
                      const std::vector<one_worker::Blocker> &blockers) {
  ResponseBound bound;
  const CompiledTask &task = task_set.tasks[t];
  if (!response || *response >= kUnbounded || *response > task.limit) {
    bound.absent = one_worker::kExceedsLimit;
    return bound;
  }
  bound.response = response;
  if (!Effort::itemises(task.unit)) return bound;
  bound.terms.push_back(Term{Term::Kind::Own, TaskId(t), task.dag, task.wcet - task.overhead, 1});
  if (task.overhead > 0) bound.terms.push_back(Term{Term::Kind::Overhead, TaskId(t), task.dag, task.overhead, 0});
  for (const one_worker::Blocker &blocker : blockers) {
    const DagId dag = task_set.tasks[blocker.task].dag;
    bound.terms.push_back(Term{Term::Kind::Blocking, TaskId(blocker.task), dag, blocker.amount, 1});
  }
  for (const std::uint32_t j : more_urgent(task_set, task)) {
    const CompiledTask &other = task_set.tasks[j];
    const std::int64_t jobs = once ? 1 : ceil_div(*response, other.period);
    bound.terms.push_back(Term{Term::Kind::Interference, TaskId(j), other.dag, multiply(jobs, other.wcet), jobs});
  }
  return bound;
}

// A DAG of independent tasks answers with its last one; for other DAGs the paper gives no bound.
void fill_dags(const TaskSet &task_set, Bound &bound) {
  bound.dags.resize(task_set.dags.size());
  for (std::size_t d = 0; d < task_set.dags.size(); ++d) {
    bound.dags[d].absent = "the equations bound callbacks, not DAGs";
    if (task_set.dags[d].units.size() != task_set.dags[d].tasks.size() || task_set.dags[d].tasks.empty()) continue;
    for (const std::uint32_t t : task_set.dags[d].tasks) {
      const ResponseBound &task = bound.tasks[t];
      if (t == task_set.dags[d].tasks.front() ||
          task.response.value_or(kNever) > bound.dags[d].response.value_or(kNever)) {
        bound.dags[d] = task;
      }
    }
  }
}

// Returns the units from the most urgent to the least; empty if their priorities are interleaved.
std::optional<std::vector<std::uint32_t>> units_by_rank(const TaskSet &task_set) {
  std::vector<std::uint32_t> order;
  std::uint32_t end = 0;  // the ranks below it are covered by whole units
  for (const std::uint32_t t : task_set.by_rank) {
    const std::uint32_t u = task_set.tasks[t].unit;
    if (task_set.units[u].first_rank != task_set.tasks[t].rank) continue;
    if (task_set.units[u].first_rank < end) return std::nullopt;
    end = task_set.units[u].last_rank + 1;
    order.push_back(u);
  }
  return order;
}

// True if the units share a tier: each can go before the other.
bool take_turns(const TaskSet &task_set, const Unit &upper, const Unit &lower) {
  return task_set.tasks[task_set.by_rank[upper.last_rank]].tier ==
         task_set.tasks[task_set.by_rank[lower.first_rank]].tier;
}

// Returns why a test by utilizations does not apply: jitter, deadlines below the period, or another order than by rate.
// Equals of one period are allowed. Whichever goes first, each waits for no more than the last one in a fixed order
// does.
std::optional<std::string> why_not_by_rate(const TaskSet &task_set, const std::vector<std::uint32_t> &order) {
  Duration last = 0;
  for (std::size_t i = 0; i < order.size(); ++i) {
    const Unit &unit = task_set.units[order[i]];
    const std::string name = unit.tasks.size() == 1 ? "task '" + task_set.tasks[unit.tasks.front()].name + "'"
                                                    : "DAG '" + task_set.dags[unit.dag.value].name + "'";
    if (i > 0 && unit.period != last && take_turns(task_set, task_set.units[order[i - 1]], unit)) {
      return name + ": it has the same priority as a task of another period";
    }
    if (unit.deadline < unit.period) return name + ": its deadline is below its period";
    if (unit.jitter > 0) return name + ": it has release jitter";
    if (unit.period < last) return name + ": it is less urgent than a task of a larger period";
    last = unit.period;
  }
  return std::nullopt;
}

// Returns why Liu and Layland's limit says nothing about the task set; empty if it is a sound test. C. Liu, J. Layland,
// Journal of the ACM 20(1), 1973: one worker, full preemption, rate-monotonic order, D >= T, no jitter, no blocking.
std::optional<std::string> why_not_liu_layland(const TaskSet &task_set) {
  if (auto reason = one_worker::why_not(task_set)) return reason;
  const auto order = units_by_rank(task_set);
  if (!order) return "in the order of priorities, tasks of other DAGs stand between those of one DAG";
  if (auto reason = why_not_by_rate(task_set, *order)) return reason;
  if (task_set.mode != sched::Preemption::Full) return "requires full preemption";
  if (can_block(task_set)) return "less urgent jobs can block (groups or shared levels)";
  return std::nullopt;
}

// True if the sum of C / T is at most the limit. For one task both are compared as whole numbers. The limit of several
// is irrational, and rounding refuses a sum within 2^-50 of it.
bool is_within_liu_layland(const TaskSet &task_set) {
  const std::vector<CompiledTask> &tasks = task_set.tasks;
  if (tasks.size() == 1) return tasks.front().wcet <= tasks.front().period;
  long double sum = 0;
  for (const CompiledTask &task : tasks) {
    sum += static_cast<long double>(task.wcet) / static_cast<long double>(task.period);
  }
  const auto n = static_cast<long double>(tasks.size());
  return !tasks.empty() && sum + std::ldexp(1.0L, -50) <= n * std::expm1(std::log(2.0L) / n);
}

Outcome apply_rm_bound(const TaskSet &task_set) {
  Bound bound;
  const auto n = static_cast<double>(task_set.tasks.size());
  const double limit = n * std::expm1(std::log(2.0) / n);
  bound.accepts = is_within_liu_layland(task_set);
  char text[96];
  std::snprintf(text, sizeof text, "U = %.4f, limit %.4f for %zu callbacks", task_set.utilization, limit,
                task_set.tasks.size());
  bound.figures = text;
  // N callbacks are at least as many as tasks or DAGs, and the limit falls with N. The test is thus sound where Liu and
  // Layland's is.
  bound.unsound = why_not_liu_layland(task_set).value_or("");
  return bound;
}

Outcome apply_interference(const TaskSet &task_set) {
  Bound bound;
  bound.unsound = broken_assumption(task_set, false);
  const std::vector<Rate> rates = rates_of(task_set);
  for (std::uint32_t t = 0; t < task_set.tasks.size(); ++t) {
    const CompiledTask &task = task_set.tasks[t];
    Duration response = task.wcet;
    const std::span<const Rate> others = more_urgent(rates, task);
    Effort::spend(others.size());
    for (const Rate &rate : others) response = add(response, rate.wcet);
    const Duration shortest = others.empty() ? kNever : others.front().period;
    if (bound.unsound.empty() && response > shortest) {
      bound.unsound =
          "'" + task.name + "': a more urgent task is released again before this one ends, but is counted once";
    }
    bound.tasks.push_back(itemise(task_set, t, response, true, {}));
  }
  fill_dags(task_set, bound);
  return bound;
}

Outcome apply_recurrence(const TaskSet &task_set, bool with_blocking) {
  Bound bound;
  bound.unsound = broken_assumption(task_set, with_blocking);
  const std::vector<Rate> rates = rates_of(task_set);
  const one_worker::Views views(task_set);
  for (std::uint32_t t = 0; t < task_set.tasks.size(); ++t) {
    const CompiledTask &task = task_set.tasks[t];
    std::vector<one_worker::Blocker> blockers;
    if (with_blocking) blockers = views.blockers(task.unit);
    Duration start = task.wcet;
    for (const one_worker::Blocker &blocker : blockers) start = add(start, blocker.amount);
    const auto response = recurrence(start, more_urgent(rates, task), task.period);
    bound.tasks.push_back(itemise(task_set, t, response, false, blockers));
  }
  fill_dags(task_set, bound);
  return bound;
}

Outcome apply_rta(const TaskSet &task_set) { return apply_recurrence(task_set, false); }
Outcome apply_rta_blocking(const TaskSet &task_set) { return apply_recurrence(task_set, true); }

Method make_paper_method(std::string_view name, Subject subject, std::string_view equation,
                         std::string_view sound_only_if, std::string_view complexity,
                         Outcome (*apply)(const TaskSet &)) {
  return Method{
      .name = name,
      .subject = subject,
      .cite = equation,
      .assumptions = "none: it evaluates the equation as it is",
      .complexity = complexity,
      .sound_only_if = sound_only_if,
      .apply = apply,
  };
}

}  // namespace

Method paper_rm_bound() {
  return make_paper_method(
      "paper_rm_bound", Subject::TaskSet, "ReDAG-RT, eq. rm_bound",
      "one worker, full preemption, rate-monotonic order, D >= T, no jitter, no blocking; DAGs of one rate", "O(n)",
      apply_rm_bound);
}

Method paper_interference() {
  return make_paper_method(
      "paper_interference", Subject::Task, "ReDAG-RT, eq. interference",
      "one worker, full preemption, rate_monotonic, different periods, no edges, jitter or blocking, and no "
      "more urgent task is released again before the task ends",
      "O(n) per task", apply_interference);
}

Method paper_rta() {
  return make_paper_method(
      "paper_rta", Subject::Task, "ReDAG-RT, eqs. rta and rta_convergence",
      "one worker, full preemption, rate_monotonic, different periods, no edges, jitter or blocking; R <= T",
      "pseudo-polynomial; O(n) per step", apply_rta);
}

Method paper_rta_blocking() {
  return make_paper_method("paper_rta_blocking", Subject::Task, "ReDAG-RT, eq. rta_blocking; B_i as on one worker",
                           "one worker, rate_monotonic, different periods, no edges or jitter; R <= T",
                           "pseudo-polynomial; O(n) per step", apply_rta_blocking);
}

}  // namespace redag::analysis
