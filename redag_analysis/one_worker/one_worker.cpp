// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/one_worker/one_worker.hpp"

#include <algorithm>
#include <map>
#include <numeric>
#include <utility>

#include "redag/sched/policy.hpp"
#include "redag_analysis/core/arithmetic.hpp"
#include "redag_analysis/core/effort.hpp"
#include "redag_analysis/core/rate_edges.hpp"

namespace redag::analysis::one_worker {
namespace {

// Limits the evaluations of the right-hand side for one task. Only busy periods with a utilization within a few
// millionths of one, or with periods many orders of magnitude apart, need more.
constexpr int kMaxSteps = 1'000'000;

bool steps_ran_out(int steps) { return steps > kMaxSteps; }

template <class Count>
Duration demand(Int128 start, std::span<const Interferer> more_urgent, Count count) {
  Int128 sum = start;
  for (const Interferer &other : more_urgent) sum += Int128{count(other)} * other.wcet;
  return saturate(sum);
}

// Finds the least w >= `w` with w = start + sum. Returns false if it exceeds `stop` or what a duration can hold, or if
// the steps run out.
template <bool kDeferred>
bool fixed_point(Int128 start, std::span<const Interferer> more_urgent, Duration stop, Duration &w, int &steps) {
  while (w <= stop && w < kUnbounded) {
    if (++steps > kMaxSteps) return false;
    Effort::spend(more_urgent.size() + 1);
    const Duration next = demand(start, more_urgent, [w](const Interferer &other) {
      const Duration until = add(w, other.jitter);
      return kDeferred ? (until + other.period) / other.period : ceil_div(until, other.period);
    });
    if (next == w) return true;
    w = next;
  }
  return false;
}

// The window in which job q must end for its response to be within the limit.
Duration stop_of(const Own &own, std::int64_t q) {
  return saturate(Int128{own.limit} - own.jitter + Int128{q} * own.period);
}

}  // namespace

std::optional<std::string> why_not(const TaskSet &task_set) {
  if (auto reason = why_not_directly(task_set)) return reason;
  if (task_set.platform.workers != 1)
    return "requires one worker, but the platform has " + std::to_string(task_set.platform.workers);
  if (!is_static(task_set.policy)) {
    return std::string("requires static priorities, but the policy is ") + to_string(task_set.policy);
  }
  if (task_set.mode == sched::Preemption::None) return std::nullopt;
  for (const CompiledDag &dag : task_set.dags) {
    if (dag.max_active > 0 && dag.units.size() > 1) {
      return "DAG '" + dag.name +
             "': its max_active can delay a task for as long as others preempt another task of the DAG";
    }
  }
  if (task_set.groups.empty()) return std::nullopt;
  if (task_set.mode == sched::Preemption::Cooperative) {
    return "in cooperative mode with groups, less urgent jobs can run on top of the holder";
  }
  if (task_set.several_executors) {
    return "with groups and several executors on the processor, a less urgent job can take its group while it does not "
           "run, and be run for a more urgent one, again and again";
  }
  if (task_set.platform.preempt_overhead > 0) return "groups cannot be combined with an overhead of preemption";
  return std::nullopt;
}

Views::Views(const TaskSet &task_set) : task_set_(task_set) {
  close_levels();
  find_longest();
}

void Views::close_levels() {
  const auto ranks = static_cast<std::uint32_t>(task_set_.by_rank.size());
  std::vector<std::uint32_t> reach(ranks);  // by rank: the least urgent task of units that begin at this rank or above
  std::iota(reach.begin(), reach.end(), 0);
  for (const Unit &unit : task_set_.units) reach[unit.first_rank] = std::max(reach[unit.first_rank], unit.last_rank);
  // Any task of a tier can go before any other of it.
  for (std::uint32_t rank = ranks; rank-- > 1;) {
    const auto tier_of = [this](std::uint32_t at) { return task_set_.tasks[task_set_.by_rank[at]].tier; };
    if (tier_of(rank) == tier_of(rank - 1)) reach[rank - 1] = std::max(reach[rank - 1], reach[rank]);
  }
  for (std::uint32_t rank = 1; rank < ranks; ++rank) reach[rank] = std::max(reach[rank], reach[rank - 1]);
  closed_.resize(ranks);
  for (std::uint32_t rank = ranks; rank-- > 0;) closed_[rank] = reach[rank] == rank ? rank : closed_[rank + 1];
}

void Views::find_longest() {
  longest_.resize(task_set_.by_rank.size() + 1);
  for (std::size_t rank = task_set_.by_rank.size(); rank-- > 0;) {
    const std::uint32_t t = task_set_.by_rank[rank];
    const Duration stretch = task_set_.tasks[t].region - 1;
    longest_[rank] = stretch > 0 && stretch >= longest_[rank + 1].amount ? Blocker{t, stretch} : longest_[rank + 1];
  }
}

std::vector<std::uint32_t> Views::more_urgent(std::uint32_t unit) const {
  std::vector<std::uint32_t> found;
  for (std::uint32_t u = 0; u < task_set_.units.size(); ++u) {
    if (u != unit && task_set_.units[u].first_rank <= level(unit)) found.push_back(u);
  }
  return found;
}

// Less urgent jobs that delay the level: they were started before the busy period and cannot be preempted. "- 1": they
// started at an instant strictly before, and times are integers.
std::vector<Blocker> Views::blockers(std::uint32_t unit) const {
  const std::uint32_t last = level(unit);
  const std::uint32_t platform_level = task_set_.tasks[task_set_.by_rank[last]].level;
  Blocker longest = longest_[last + 1];
  if (task_set_.mode != sched::Preemption::None) {
    // Tasks of one platform level are neighbours in the order, and do not preempt each other.
    for (std::uint32_t rank = last + 1; rank < task_set_.by_rank.size(); ++rank) {
      const std::uint32_t t = task_set_.by_rank[rank];
      if (task_set_.tasks[t].level != platform_level) break;
      Effort::spend(1);
      const Duration amount = task_set_.tasks[t].wcet - 1;
      const bool is_first = amount == longest.amount && rank < task_set_.tasks[longest.task].rank;
      if (amount > longest.amount || is_first) longest = Blocker{t, amount};
    }
  }
  std::vector<Blocker> found;
  if (task_set_.mode == sched::Preemption::Full) {
    for (const std::vector<std::uint32_t> &group : task_set_.groups) {
      Effort::spend(group.size());
      // While a job holds the group for a task of this platform level or above, no task of the level preempts it.
      bool is_needed = false;
      Blocker holder;
      for (const std::uint32_t t : group) {
        const CompiledTask &task = task_set_.tasks[t];
        is_needed = is_needed || task.level <= platform_level;
        if (task.rank <= last) continue;
        const bool is_longer = task.wcet - 1 > holder.amount ||
                               (task.wcet - 1 == holder.amount && task.rank < task_set_.tasks[holder.task].rank);
        if (is_longer && task.wcet > 1) holder = Blocker{t, task.wcet - 1};
      }
      if (is_needed && holder.amount > 0) found.push_back(holder);
    }
  }
  if (longest.amount > 0) found.push_back(longest);
  return found;
}

FixedPoint no_fixed_point(int steps) {
  return FixedPoint{std::nullopt, steps_ran_out(steps) ? kGaveUp : kExceedsLimit};
}

std::int64_t jobs_in(const Interferer &task, Duration window, bool deferred) {
  const Duration until = add(window, task.jitter);
  return deferred ? (until + task.period) / task.period : ceil_div(until, task.period);
}

FixedPoint preemptive_response(const Own &own, std::span<const Interferer> more_urgent) {
  Response worst;
  int steps = 0;
  Duration w = 0;
  for (std::int64_t q = 0;; ++q) {
    const Int128 start = Int128{own.blocking} + (Int128{q} + 1) * own.wcet;
    w = std::max(w, saturate(start));
    if (!fixed_point<false>(start, more_urgent, stop_of(own, q), w, steps)) return no_fixed_point(steps);
    const auto response = static_cast<Duration>(Int128{own.jitter} + w - Int128{q} * own.period);
    const auto from_ready = static_cast<Duration>(w - std::max(Int128{0}, Int128{q} * own.period - own.jitter));
    const Duration longest = std::max(worst.from_ready, from_ready);
    if (response > worst.response) worst = Response{response, w, q, 0};
    worst.from_ready = longest;
    // The next job comes when all work of this level is done: the busy period is over.
    if (response <= own.period) return FixedPoint{worst, {}};
  }
}

bool settle(bool deferred, Int128 start, std::span<const Interferer> more_urgent, Duration stop, Duration &window,
            int &steps) {
  return deferred ? fixed_point<true>(start, more_urgent, stop, window, steps)
                  : fixed_point<false>(start, more_urgent, stop, window, steps);
}

}  // namespace redag::analysis::one_worker
