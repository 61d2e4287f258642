// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/one_worker/utilization.hpp"

#include <algorithm>
#include <cstdio>
#include <span>
#include <vector>

#include "redag/sched/policy.hpp"
#include "redag_analysis/core/arithmetic.hpp"
#include "redag_analysis/core/exact_utilization.hpp"
#include "redag_analysis/core/rate_edges.hpp"
#include "redag_analysis/one_worker/one_worker.hpp"

namespace redag::analysis {
namespace {

constexpr Int128 kUtilizationUnit = Int128{1} << 60;  // utilizations in units of 2^-60, to be shown

Int128 rounded(const ShareRange &range) { return static_cast<Int128>(range.low); }

double utilization_as_double(Int128 value) {
  return static_cast<double>(value) / static_cast<double>(kUtilizationUnit);
}

std::string figures(const char *name, Int128 value, Int128 limit) {
  char text[96];
  std::snprintf(text, sizeof text, "%s = %.4f, limit %.4f", name, utilization_as_double(value),
                utilization_as_double(limit));
  return text;
}

Bound answer(bool accepts, std::string figures) {
  Bound bound;
  bound.accepts = accepts;
  bound.figures = std::move(figures);
  return bound;
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

struct Prepared {
  std::vector<std::uint32_t> order;  // units, most urgent first
  std::vector<Duration> blocking;
};

std::optional<std::string> prepare(const TaskSet &task_set, bool with_blocking, Prepared &prepared) {
  if (auto reason = one_worker::why_not(task_set)) return reason;
  const auto order = units_by_rank(task_set);
  if (!order) return "in the order of priorities, tasks of other DAGs stand between those of one DAG";
  if (auto reason = why_not_by_rate(task_set, *order)) return reason;
  if (!with_blocking && task_set.mode != sched::Preemption::Full)
    return "requires full preemption: see the test with blocking";
  prepared.order = *order;
  const one_worker::Views views(task_set);
  for (const std::uint32_t u : *order) {
    prepared.blocking.push_back(views.blocking(u));
    if (!with_blocking && prepared.blocking.back() > 0) {
      return "less urgent jobs can block (groups or shared levels): see the test with blocking";
    }
  }
  return std::nullopt;
}

Share share_of(const Unit &unit, Duration blocking = 0) {
  return Share{static_cast<Uint128>(unit.volume) + static_cast<Uint128>(blocking), unit.period};
}

Shares shares_of(const TaskSet &task_set) {
  Shares shares;
  for (const Unit &unit : task_set.units) shares.push(share_of(unit));
  return shares;
}

// Tests level by level, each with its blocking; the answer names the first level above its limit.
Outcome apply_hyperbolic_blocking(const TaskSet &task_set) {
  Prepared prepared;
  if (auto reason = prepare(task_set, true, prepared)) return NotApplicable{*reason};
  Shares shares;
  for (std::size_t i = 0; i < prepared.order.size(); ++i) {
    const Unit &unit = task_set.units[prepared.order[i]];
    shares.push(share_of(unit, prepared.blocking[i]));
    if (!is_within_hyperbolic(shares)) {
      return answer(false, figures("product", rounded(shares.product()), 2 * kUtilizationUnit) + " at '" +
                               task_set.tasks[unit.tasks.front()].name + "'");
    }
    shares.pop();
    shares.push(share_of(unit));
  }
  return answer(true, "every level is within its limit");
}

// Returns why a global test does not apply. It needs m workers, full preemption and independent tasks, and that only
// priority delays a job.
std::optional<std::string> why_not_global(const TaskSet &task_set) {
  if (auto reason = why_not_directly(task_set)) return reason;
  // With m = 1 the limits would be 1 or more, which fixed priorities do not reach.
  if (task_set.platform.workers < 2) return "requires two workers or more";
  if (!is_static(task_set.policy)) {
    return std::string("requires rate-monotonic priorities, but the policy is ") + to_string(task_set.policy);
  }
  if (task_set.mode != sched::Preemption::Full) return "requires full preemption";
  if (task_set.has_edges()) return "tasks have predecessors";
  if (!task_set.groups.empty()) return "tasks share groups";
  for (const CompiledDag &dag : task_set.dags) {
    if (dag.max_active > 0 && dag.tasks.size() > 1) return "DAG '" + dag.name + "' has a max_active";
  }
  for (std::size_t rank = 1; rank < task_set.by_rank.size(); ++rank) {
    const CompiledTask &upper = task_set.tasks[task_set.by_rank[rank - 1]];
    const CompiledTask &lower = task_set.tasks[task_set.by_rank[rank]];
    if (upper.level == lower.level && upper.tier != lower.tier) return "tasks of different priorities share a level";
  }
  return why_not_by_rate(task_set, *units_by_rank(task_set));
}

// The largest share alone.
Shares largest(const Shares &shares) {
  Shares one;
  const auto found = std::max_element(shares.all().begin(), shares.all().end(), is_smaller);
  if (found != shares.all().end()) one.push(*found);
  return one;
}

Outcome apply_global_rm_utilization(const TaskSet &task_set) {
  if (auto reason = why_not_global(task_set)) return NotApplicable{*reason};
  const std::uint64_t m = task_set.platform.workers;
  const Shares shares = shares_of(task_set);
  const Shares most = largest(shares);
  Shares weighted;  // 2 U + (m - 2) u <= m
  for (const Share &share : shares.all()) weighted.push({share.amount * 2, share.period});
  for (const Share &share : most.all()) weighted.push({share.amount * (m - 2), share.period});
  const Int128 limit =
      (static_cast<Int128>(m) * (kUtilizationUnit - rounded(most.sum())) + 2 * rounded(most.sum())) / 2;
  return answer(is_sum_within(most, 1, 1) && is_sum_within(weighted, m, 1), figures("U", rounded(shares.sum()), limit));
}

}  // namespace

std::optional<std::string> why_not_liu_layland(const TaskSet &task_set) {
  Prepared prepared;
  return prepare(task_set, false, prepared);
}

Method hyperbolic_blocking() {
  return Method{
      .name = "hyperbolic_blocking",
      .subject = Subject::TaskSet,
      .cite =
          "the hyperbolic bound (E. Bini, G. C. Buttazzo, G. M. Buttazzo, IEEE Transactions on Computers 52(7), "
          "2003) with the blocking of L. Sha, R. Rajkumar, J. Lehoczky, ibid. 39(9), 1990",
      .assumptions =
          "one worker, any preemption, rate-monotonic order, D >= T, no jitter; a DAG of one rate counts as one task "
          "with C = volume",
      .complexity = "O(n log n)",
      .quick = true,
      .apply = apply_hyperbolic_blocking,
  };
}

Method global_rm_utilization() {
  return Method{
      .name = "global_rm_utilization",
      .subject = Subject::TaskSet,
      .cite =
          "M. Bertogna, M. Cirinei, G. Lipari, New schedulability tests for real-time task sets scheduled by "
          "deadline monotonic on multiprocessors, OPODIS 2005",
      .assumptions =
          "m >= 2 workers, full preemption, rate-monotonic order, independent tasks, D >= T, no jitter, groups, "
          "max_active or levels that different rates share",
      .complexity = "O(n)",
      .quick = true,
      .apply = apply_global_rm_utilization,
  };
}

}  // namespace redag::analysis
