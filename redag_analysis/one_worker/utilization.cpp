// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/one_worker/utilization.hpp"

#include <algorithm>
#include <cstdio>
#include <span>
#include <vector>

#include "redag/sched/policy.hpp"
#include "redag_analysis/core/arithmetic.hpp"
#include "redag_analysis/core/effort.hpp"
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

Outcome apply_liu_layland(const TaskSet &task_set) {
  Prepared prepared;
  if (auto reason = prepare(task_set, false, prepared)) return NotApplicable{*reason};
  const Shares shares = shares_of(task_set);
  return answer(is_within_liu_layland(shares, shares.size()),
                figures("U", rounded(shares.sum()), liu_layland_limit(shares.size())));
}

Outcome apply_hyperbolic(const TaskSet &task_set) {
  Prepared prepared;
  if (auto reason = prepare(task_set, false, prepared)) return NotApplicable{*reason};
  const Shares shares = shares_of(task_set);
  return answer(is_within_hyperbolic(shares),
                figures("prod (U_i + 1)", rounded(shares.product()), 2 * kUtilizationUnit));
}

// A maximum matching between periods and their multiples (Kuhn); each unmatched period starts a chain. Units of one
// period are always in one chain, and therefore only different periods matter.
class ChainCover {
 public:
  explicit ChainCover(const TaskSet &task_set) {
    for (const Unit &unit : task_set.units) periods_.push_back(unit.period);
    std::sort(periods_.begin(), periods_.end());
    periods_.erase(std::unique(periods_.begin(), periods_.end()), periods_.end());
    next_.assign(periods_.size(), kNone);
  }

  std::size_t chains() {
    std::size_t matched = 0;
    for (std::size_t u = 0; u < periods_.size(); ++u) matched += extend(u) ? 1U : 0U;
    return periods_.size() - matched;
  }

 private:
  static constexpr std::size_t kNone = SIZE_MAX;

  // Searches breadth first from the unmatched `root`; returns true if it found an augmenting path.
  bool extend(std::size_t root) {
    std::vector<std::size_t> reached_by(periods_.size(), kNone);  // by longer period
    std::vector<std::size_t> waiting = {root};
    for (std::size_t i = 0; i < waiting.size(); ++i) {
      const std::size_t u = waiting[i];
      Effort::spend(periods_.size() - u);
      for (std::size_t v = u + 1; v < periods_.size(); ++v) {
        if (reached_by[v] != kNone || periods_[v] % periods_[u] != 0) continue;
        reached_by[v] = u;
        if (next_[v] != kNone) {
          waiting.push_back(next_[v]);
          continue;
        }
        turn_around(v, root, reached_by);
        return true;
      }
    }
    return false;
  }

  void turn_around(std::size_t last, std::size_t root, const std::vector<std::size_t> &reached_by) {
    for (std::size_t v = last;;) {
      const std::size_t u = reached_by[v];
      const std::size_t before = match_of(u);
      next_[v] = u;
      if (u == root) return;
      v = before;
    }
  }

  // The longer period that `u` is matched with.
  [[nodiscard]] std::size_t match_of(std::size_t u) const {
    return static_cast<std::size_t>(std::find(next_.begin(), next_.end(), u) - next_.begin());
  }

  std::vector<Duration> periods_;  // different values, ascending
  std::vector<std::size_t> next_;  // by longer period: its predecessor in its chain
};

Outcome apply_harmonic_chains(const TaskSet &task_set) {
  Prepared prepared;
  if (auto reason = prepare(task_set, false, prepared)) return NotApplicable{*reason};
  const std::size_t chains = ChainCover(task_set).chains();
  const Shares shares = shares_of(task_set);
  return answer(is_within_liu_layland(shares, chains), figures("U", rounded(shares.sum()), liu_layland_limit(chains)) +
                                                           ", " + std::to_string(chains) + " harmonic chains");
}

// Tests level by level, each with its blocking; the answer names the first level above its limit.
template <class Within, class Figures>
Outcome apply_by_level(const TaskSet &task_set, Within is_within, Figures figures_of) {
  Prepared prepared;
  if (auto reason = prepare(task_set, true, prepared)) return NotApplicable{*reason};
  Shares shares;
  for (std::size_t i = 0; i < prepared.order.size(); ++i) {
    const Unit &unit = task_set.units[prepared.order[i]];
    shares.push(share_of(unit, prepared.blocking[i]));
    if (!is_within(shares)) {
      return answer(false, figures_of(shares) + " at '" + task_set.tasks[unit.tasks.front()].name + "'");
    }
    shares.pop();
    shares.push(share_of(unit));
  }
  return answer(true, "every level is within its limit");
}

Outcome apply_liu_layland_blocking(const TaskSet &task_set) {
  return apply_by_level(
      task_set, [](const Shares &shares) { return is_within_liu_layland(shares, shares.size()); },
      [](const Shares &shares) {
        return figures("U + B / T", rounded(shares.sum()), liu_layland_limit(shares.size()));
      });
}

Outcome apply_hyperbolic_blocking(const TaskSet &task_set) {
  return apply_by_level(
      task_set, [](const Shares &shares) { return is_within_hyperbolic(shares); },
      [](const Shares &shares) { return figures("product", rounded(shares.product()), 2 * kUtilizationUnit); });
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

Outcome apply_global_rm_light(const TaskSet &task_set) {
  if (auto reason = why_not_global(task_set)) return NotApplicable{*reason};
  const std::uint64_t m = task_set.platform.workers;
  const Shares shares = shares_of(task_set);
  const Shares most = largest(shares);
  const bool fits = is_sum_within(shares, m * m, 3 * m - 2) && is_sum_within(most, m, 3 * m - 2);
  const auto divisor = static_cast<Int128>(3 * m - 2);
  return answer(fits, figures("U", rounded(shares.sum()), static_cast<Int128>(m * m) * kUtilizationUnit / divisor) +
                          "; " +
                          figures("max U_i", rounded(most.sum()), static_cast<Int128>(m) * kUtilizationUnit / divisor));
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

Method make(std::string_view name, std::string_view cite, std::string_view assumptions, std::string_view complexity,
            Outcome (*apply)(const TaskSet &)) {
  return Method{
      .name = name,
      .subject = Subject::TaskSet,
      .cite = cite,
      .assumptions = assumptions,
      .complexity = complexity,
      .quick = true,
      .apply = apply,
  };
}

constexpr std::string_view kOneWorker =
    "one worker, full preemption, rate-monotonic order, D >= T, no jitter, no blocking; a DAG of one rate counts as "
    "one task with C = volume";
constexpr std::string_view kOneWorkerBlocking =
    "one worker, any preemption, rate-monotonic order, D >= T, no jitter; a DAG of one rate counts as one task with C "
    "= volume";
constexpr std::string_view kGlobal =
    "m >= 2 workers, full preemption, rate-monotonic order, independent tasks, D >= T, no jitter, groups, max_active "
    "or levels that different rates share";

}  // namespace

Method liu_layland() {
  return make("liu_layland",
              "C. Liu, J. Layland, Scheduling algorithms for multiprogramming in a hard-real-time environment, Journal "
              "of the ACM 20(1), 1973",
              kOneWorker, "O(n)", apply_liu_layland);
}

Method hyperbolic() {
  return make("hyperbolic",
              "E. Bini, G. C. Buttazzo, G. M. Buttazzo, Rate monotonic analysis: the hyperbolic bound, IEEE "
              "Transactions on Computers 52(7), 2003",
              kOneWorker, "O(n)", apply_hyperbolic);
}

Method harmonic_chains() {
  return make("harmonic_chains", "T.-W. Kuo, A. K. Mok, Load adjustment in adaptive real-time systems, RTSS 1991",
              kOneWorker, "O(n), and a maximum matching of the different periods", apply_harmonic_chains);
}

Method liu_layland_blocking() {
  return make(
      "liu_layland_blocking",
      "L. Sha, R. Rajkumar, J. Lehoczky, Priority inheritance protocols, IEEE Transactions on Computers 39(9), 1990",
      kOneWorkerBlocking, "O(n log n)", apply_liu_layland_blocking);
}

Method hyperbolic_blocking() {
  return make("hyperbolic_blocking",
              "the hyperbolic bound (Bini, Buttazzo, Buttazzo 2003) with the blocking of Sha, Rajkumar, Lehoczky 1990",
              kOneWorkerBlocking, "O(n log n)", apply_hyperbolic_blocking);
}

Method global_rm_light() {
  return make("global_rm_light",
              "B. Andersson, S. Baruah, J. Jonsson, Static-priority scheduling on multiprocessors, RTSS 2001", kGlobal,
              "O(n)", apply_global_rm_light);
}

Method global_rm_utilization() {
  return make("global_rm_utilization",
              "M. Bertogna, M. Cirinei, G. Lipari, New schedulability tests for real-time task sets scheduled by "
              "deadline monotonic on multiprocessors, OPODIS 2005",
              kGlobal, "O(n)", apply_global_rm_utilization);
}

}  // namespace redag::analysis
