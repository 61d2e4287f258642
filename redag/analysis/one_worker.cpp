#include "redag/analysis/one_worker.hpp"

#include <algorithm>

#include "redag/analysis/arithmetic.hpp"
#include "redag/analysis/rate_edges.hpp"
#include "redag/sched/policy.hpp"

namespace redag::analysis::one_worker {
namespace {

// Evaluations of the right-hand side for one task. Only busy periods with a utilization within a few millionths of one,
// or periods many orders of magnitude apart, need more.
constexpr int kMaxSteps = 1'000'000;

// The level of the busy period as a rank: all work of this rank and above belongs to whole units.
std::uint32_t closed_level(const System &system, std::uint32_t unit) {
  std::uint32_t level = system.units[unit].last_rank;
  for (bool grew = true; grew;) {
    grew = false;
    for (const Unit &other : system.units) {
      if (other.first_rank > level || other.last_rank <= level) continue;
      level = other.last_rank;
      grew = true;
    }
  }
  return level;
}

// Less urgent jobs that hold up the level although it has work: what was started before the busy period and cannot be
// preempted. "- 1": it started at an instant strictly before, and times are integers.
void find_blockers(const System &system, std::uint32_t level, View &view) {
  Blocker longest;
  std::vector<Blocker> holders(system.groups.size());
  const std::uint32_t platform_level = system.tasks[system.by_rank[level]].level;
  const bool shares = system.mode != sched::Preemption::None;
  for (std::uint32_t rank = level + 1; rank < system.by_rank.size(); ++rank) {
    const std::uint32_t t = system.by_rank[rank];
    const SystemTask &task = system.tasks[t];
    const bool whole = shares && task.level == platform_level;
    const Duration stretch = (whole ? task.wcet : task.region) - 1;
    if (stretch > longest.amount) longest = Blocker{t, stretch};
    if (system.mode != sched::Preemption::Full || task.group == kNoGroup) continue;
    const auto &group = system.groups[task.group];
    // While it holds the group for a task of this platform level or above, no task of the level preempts it.
    const bool is_needed = std::any_of(
        group.begin(), group.end(), [&](std::uint32_t other) { return system.tasks[other].level <= platform_level; });
    Blocker &holder = holders[task.group];
    if (is_needed && task.wcet - 1 > holder.amount) holder = Blocker{t, task.wcet - 1};
  }
  holders.push_back(longest);
  for (const Blocker &blocker : holders) {
    if (blocker.amount <= 0) continue;
    view.blockers.push_back(blocker);
    view.blocking = add(view.blocking, blocker.amount);
  }
}

template <class Count>
Duration demand(Int128 start, std::span<const Interferer> more_urgent, Count count) {
  Int128 sum = start;
  for (const Interferer &other : more_urgent) sum += Int128{count(other)} * other.wcet;
  return saturate(sum);
}

// The least w >= `w` with w = start + sum, or nothing where it exceeds `stop`, or what a time can hold, or the steps
// run out.
template <bool kDeferred>
bool fixed_point(Int128 start, std::span<const Interferer> more_urgent, Duration stop, Duration &w, int &steps) {
  while (w <= stop && w < kUnbounded) {
    if (++steps > kMaxSteps) return false;
    const Duration next = demand(start, more_urgent, [w](const Interferer &other) {
      const Duration until = add(w, other.jitter);
      return kDeferred ? until / other.period + 1 : ceil_div(until, other.period);
    });
    if (next == w) return true;
    w = next;
  }
  return false;
}

FixedPoint none(int steps) { return FixedPoint{std::nullopt, steps > kMaxSteps ? kGaveUp : kExceedsLimit}; }

// Window in which job q must end so that its response is within the limit.
Duration stop_of(const Own &own, std::int64_t q) {
  return saturate(Int128{own.limit} - own.jitter + Int128{q} * own.period);
}

std::vector<Term> terms_of(const System &system, const Unit &unit, const View &view, const Response &response,
                           bool deferred) {
  Duration overhead = 0;
  for (const std::uint32_t t : unit.tasks) overhead = add(overhead, system.tasks[t].overhead);
  std::vector<Term> terms;
  const TaskId self = unit.tasks.size() == 1 ? TaskId(unit.tasks.front()) : TaskId();
  terms.push_back(Term{Term::Kind::Own, self, unit.dag, unit.volume - overhead, 1});
  if (overhead > 0) terms.push_back(Term{Term::Kind::Overhead, self, unit.dag, overhead, 0});
  if (response.job > 0) {
    const Duration earlier = response.job * (unit.volume - unit.period);
    terms.push_back(Term{Term::Kind::Earlier, self, unit.dag, earlier, response.job});
  }
  for (const Blocker &blocker : view.blockers) {
    terms.push_back(
        Term{Term::Kind::Blocking, TaskId(blocker.task), system.tasks[blocker.task].dag, blocker.amount, 1});
  }
  for (std::size_t i = 0; i < view.more_urgent.size(); ++i) {
    const Unit &other = system.units[view.units[i]];
    const std::int64_t jobs = jobs_in(view.more_urgent[i], response.window, deferred);
    const TaskId task = other.tasks.size() == 1 ? TaskId(other.tasks.front()) : TaskId();
    terms.push_back(Term{Term::Kind::Interference, task, other.dag, jobs * other.volume, jobs});
  }
  if (unit.jitter > 0) terms.push_back(Term{Term::Kind::Jitter, self, unit.dag, unit.jitter, 0});
  return terms;
}

// Any of its last tasks can be the one that ends the unit; the shortest stretch is the worst.
Duration last_region_of(const System &system, const Unit &unit) {
  Duration shortest = kUnbounded;
  for (const std::uint32_t t : unit.tasks) {
    if (system.tasks[t].successors.empty()) shortest = std::min(shortest, system.tasks[t].last_region);
  }
  return shortest;
}

}  // namespace

std::optional<std::string> why_not(const System &system) {
  if (auto reason = why_not_directly(system)) return reason;
  if (system.platform.workers != 1)
    return "for one worker; the platform has " + std::to_string(system.platform.workers);
  if (!sched::is_static(system.policy)) {
    return std::string("for static priorities; the policy is ") + to_string(system.policy);
  }
  if (system.mode == sched::Preemption::None) return std::nullopt;
  for (const SystemDag &dag : system.dags) {
    if (dag.max_active > 0 && dag.units.size() > 1) {
      return "DAG '" + dag.name +
             "': its max_active can hold up a task for as long as others preempt another task of it";
    }
  }
  if (system.groups.empty()) return std::nullopt;
  if (system.mode == sched::Preemption::Cooperative) {
    return "groups in cooperative mode: the holder can lie under less urgent jobs";
  }
  if (system.platform.preempt_overhead > 0) return "groups together with an overhead of preemption";
  return std::nullopt;
}

View view_of(const System &system, std::uint32_t unit) {
  const std::uint32_t level = closed_level(system, unit);
  View view;
  view.interleaved = level != system.units[unit].last_rank;
  for (std::uint32_t u = 0; u < system.units.size(); ++u) {
    const Unit &other = system.units[u];
    if (u == unit || other.first_rank > level) continue;
    view.units.push_back(u);
    view.more_urgent.push_back(Interferer{other.volume, other.period, other.jitter});
  }
  find_blockers(system, level, view);
  return view;
}

std::int64_t jobs_in(const Interferer &task, Duration window, bool deferred) {
  const Duration until = add(window, task.jitter);
  return deferred ? until / task.period + 1 : ceil_div(until, task.period);
}

FixedPoint preemptive_response(const Own &own, std::span<const Interferer> more_urgent) {
  Response worst;
  int steps = 0;
  Duration w = 0;
  for (std::int64_t q = 0;; ++q) {
    const Int128 start = Int128{own.blocking} + (Int128{q} + 1) * own.wcet;
    w = std::max(w, saturate(start));
    if (!fixed_point<false>(start, more_urgent, stop_of(own, q), w, steps)) return none(steps);
    const auto response = static_cast<Duration>(Int128{own.jitter} + w - Int128{q} * own.period);
    const auto from_ready = static_cast<Duration>(w - std::max(Int128{0}, Int128{q} * own.period - own.jitter));
    const Duration longest = std::max(worst.from_ready, from_ready);
    if (response > worst.response) worst = Response{response, w, q, 0};
    worst.from_ready = longest;
    // The next job comes when all work of this level is done: the busy period is over.
    if (response <= own.period) return FixedPoint{worst, {}};
  }
}

FixedPoint deferred_response(const Own &own, std::span<const Interferer> more_urgent) {
  int steps = 0;
  Response worst;
  Duration w = 0;
  // The busy period ends where all work that arrived before is done; jobs of this task arrive until then.
  Duration length = 0;
  for (std::int64_t q = 0;; ++q) {
    const Int128 start = Int128{own.blocking} + (Int128{q} + 1) * own.wcet - own.last_region;
    w = std::max(w, saturate(start));
    if (!fixed_point<true>(start, more_urgent, stop_of(own, q) - own.last_region, w, steps)) return none(steps);
    const auto response = static_cast<Duration>(Int128{own.jitter} + w - Int128{q} * own.period + own.last_region);
    const auto from_ready =
        static_cast<Duration>(Int128{w} + own.last_region - std::max(Int128{0}, Int128{q} * own.period - own.jitter));
    const Duration longest = std::max(worst.from_ready, from_ready);
    if (response > worst.response) worst = Response{response, w, q, 0};
    worst.from_ready = longest;
    // With q + 1 jobs of its own, does the busy period end before the next one arrives?
    const Int128 all = Int128{own.blocking} + (Int128{q} + 1) * own.wcet;
    const Duration next_arrival = saturate((Int128{q} + 1) * own.period - own.jitter);
    length = std::max({length, saturate(all), w});
    if (fixed_point<false>(all, more_urgent, next_arrival, length, steps)) return FixedPoint{worst, {}};
    if (steps > kMaxSteps) return none(steps);
  }
}

Bound bound_units(const System &system, bool deferred) {
  std::vector<ResponseBound> responses(system.units.size());
  for (std::uint32_t u = 0; u < system.units.size(); ++u) {
    const Unit &unit = system.units[u];
    const View view = view_of(system, u);
    const Own own{unit.volume, unit.period,   unit.jitter,
                  unit.limit,  view.blocking, deferred ? last_region_of(system, unit) : 0};
    const FixedPoint result =
        deferred ? deferred_response(own, view.more_urgent) : preemptive_response(own, view.more_urgent);
    if (!result.found) {
      responses[u].absent = result.absent;
      continue;
    }
    responses[u].response = result.found->response;
    responses[u].from_ready = result.found->from_ready;
    responses[u].terms = terms_of(system, unit, view, *result.found, deferred);
  }
  return from_units(system, std::move(responses));
}

}  // namespace redag::analysis::one_worker
