#include "redag/analysis/utilization.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "redag/analysis/arithmetic.hpp"
#include "redag/analysis/one_worker.hpp"
#include "redag/analysis/rate_edges.hpp"
#include "redag/sched/policy.hpp"

namespace redag::analysis {
namespace {

// Utilizations in units of 2^-60: one is 2^60, and a sum of 2^60 of them still fits into 128 bits.
constexpr Int128 kOne = Int128{1} << 60;

// numerator / denominator, rounded up. Durations have 62 bits, so the product fits.
Int128 share(Duration numerator, Duration denominator) {
  const Int128 scaled = Int128{numerator} * kOne;
  return scaled / denominator + (scaled % denominator != 0 ? 1 : 0);
}

// n (2^(1/n) - 1), rounded down: long double has 64 bits, its functions are right to a few of the last.
Int128 liu_layland_limit(std::size_t n) {
  if (n == 0) return kOne;
  const auto count = static_cast<long double>(n);
  const long double limit = n == 1 ? 1.0L : count * std::expm1(std::log(2.0L) / count);
  return static_cast<Int128>(limit * static_cast<long double>(kOne)) - (n == 1 ? 0 : 1024);
}

double as_double(Int128 value) { return static_cast<double>(value) / static_cast<double>(kOne); }

std::string figures(const char *name, Int128 value, Int128 limit) {
  char text[96];
  std::snprintf(text, sizeof text, "%s = %.4f, limit %.4f", name, as_double(value), as_double(limit));
  return text;
}

Bound answer(bool accepts, std::string figures) {
  Bound bound;
  bound.accepts = accepts;
  bound.figures = std::move(figures);
  return bound;
}

// Units from the most urgent to the least, or nothing where their priorities are interleaved.
std::optional<std::vector<std::uint32_t>> units_by_rank(const System &system) {
  std::vector<std::uint32_t> order;
  std::uint32_t end = 0;  // ranks below are covered by whole units
  for (const std::uint32_t t : system.by_rank) {
    const std::uint32_t u = system.tasks[t].unit;
    if (system.units[u].first_rank != system.tasks[t].rank) continue;
    if (system.units[u].first_rank < end) return std::nullopt;
    end = system.units[u].last_rank + 1;
    order.push_back(u);
  }
  return order;
}

// Utilizations know nothing of jitter, of deadlines below the period, or of another order than by rate.
std::optional<std::string> why_not_by_rate(const System &system, const std::vector<std::uint32_t> &order) {
  Duration last = 0;
  for (const std::uint32_t u : order) {
    const Unit &unit = system.units[u];
    const std::string name = unit.tasks.size() == 1 ? "task '" + system.tasks[unit.tasks.front()].name + "'"
                                                    : "DAG '" + system.dags[unit.dag.value].name + "'";
    if (unit.deadline < unit.period) return name + ": its deadline is below its period";
    if (unit.jitter > 0) return name + ": it has release jitter";
    if (unit.period < last) return name + ": it is less urgent than one of a larger period";
    last = unit.period;
  }
  return std::nullopt;
}

struct Prepared {
  std::vector<std::uint32_t> order;  // units, most urgent first
  std::vector<Duration> blocking;
};

std::optional<std::string> prepare(const System &system, bool with_blocking, Prepared &prepared) {
  if (auto reason = one_worker::why_not(system)) return reason;
  const auto order = units_by_rank(system);
  if (!order) return "tasks of other DAGs stand between those of one DAG in the order of priorities";
  if (auto reason = why_not_by_rate(system, *order)) return reason;
  if (!with_blocking && system.mode != sched::Preemption::Full)
    return "for full preemption: see the test with blocking";
  prepared.order = *order;
  for (const std::uint32_t u : *order) {
    prepared.blocking.push_back(one_worker::view_of(system, u).blocking);
    if (!with_blocking && prepared.blocking.back() > 0) {
      return "less urgent jobs can block (groups or shared levels): see the test with blocking";
    }
  }
  return std::nullopt;
}

Int128 total_share(const System &system) {
  Int128 sum = 0;
  for (const Unit &unit : system.units) sum += share(unit.volume, unit.period);
  return sum;
}

// sum C_i / T_i <= 1 without rounding, where all periods divide the largest one.
bool harmonic_fits(const System &system) {
  Duration longest = 1;
  for (const Unit &unit : system.units) longest = std::max(longest, unit.period);
  Int128 demand = 0;
  for (const Unit &unit : system.units) {
    if (longest % unit.period != 0) return false;
    demand += Int128{longest / unit.period} * unit.volume;
  }
  return demand <= longest;
}

Outcome apply_liu_layland(const System &system) {
  Prepared prepared;
  if (auto reason = prepare(system, false, prepared)) return NotApplicable{*reason};
  const Int128 utilization = total_share(system);
  const Int128 limit = liu_layland_limit(system.units.size());
  return answer(utilization <= limit, figures("U", utilization, limit));
}

// x (U + 1), rounded up; saturates well above two.
Int128 times_one_plus(Int128 x, Int128 utilization) {
  if (x > 4 * kOne || utilization > 4 * kOne) return 8 * kOne;
  const Int128 product = x * (utilization + kOne);
  return product / kOne + (product % kOne != 0 ? 1 : 0);
}

Outcome apply_hyperbolic(const System &system) {
  Prepared prepared;
  if (auto reason = prepare(system, false, prepared)) return NotApplicable{*reason};
  Int128 product = kOne;
  for (const Unit &unit : system.units) product = times_one_plus(product, share(unit.volume, unit.period));
  return answer(product <= 2 * kOne, figures("prod (U_i + 1)", product, 2 * kOne));
}

// A matching of maximum size between periods and their multiples (Kuhn); what is not matched starts a chain.
class ChainCover {
 public:
  explicit ChainCover(const System &system) : system_(system), next_(system.units.size(), kNone) {}

  std::size_t chains() {
    std::size_t matched = 0;
    for (std::uint32_t u = 0; u < system_.units.size(); ++u) {
      visited_.assign(system_.units.size(), false);
      matched += extend(u) ? 1U : 0U;
    }
    return system_.units.size() - matched;
  }

 private:
  static constexpr std::uint32_t kNone = 0xffffffff;

  [[nodiscard]] bool before(std::uint32_t a, std::uint32_t b) const {
    const Duration shorter = system_.units[a].period;
    const Duration longer = system_.units[b].period;
    return a != b && longer % shorter == 0 && (longer > shorter || a < b);
  }
  bool extend(std::uint32_t u) {
    for (std::uint32_t v = 0; v < system_.units.size(); ++v) {
      if (visited_[v] || !before(u, v)) continue;
      visited_[v] = true;
      if (next_[v] == kNone || extend(next_[v])) {
        next_[v] = u;
        return true;
      }
    }
    return false;
  }

  const System &system_;
  std::vector<std::uint32_t> next_;  // by longer period: the shorter one before it in its chain
  std::vector<bool> visited_;
};

Outcome apply_harmonic_chains(const System &system) {
  Prepared prepared;
  if (auto reason = prepare(system, false, prepared)) return NotApplicable{*reason};
  const std::size_t chains = ChainCover(system).chains();
  const Int128 utilization = total_share(system);
  const Int128 limit = liu_layland_limit(chains);
  const bool fits = utilization <= limit || (chains <= 1 && harmonic_fits(system));
  return answer(fits, figures("U", utilization, limit) + ", " + std::to_string(chains) + " harmonic chains");
}

Outcome apply_liu_layland_blocking(const System &system) {
  Prepared prepared;
  if (auto reason = prepare(system, true, prepared)) return NotApplicable{*reason};
  Int128 above = 0;
  for (std::size_t i = 0; i < prepared.order.size(); ++i) {
    const Unit &unit = system.units[prepared.order[i]];
    above += share(unit.volume, unit.period);
    const Int128 demand = above + share(prepared.blocking[i], unit.period);
    const Int128 limit = liu_layland_limit(i + 1);
    if (demand > limit) {
      return answer(false, figures("U + B / T", demand, limit) + " at '" + system.tasks[unit.tasks.front()].name + "'");
    }
  }
  return answer(true, "every level within its limit");
}

Outcome apply_hyperbolic_blocking(const System &system) {
  Prepared prepared;
  if (auto reason = prepare(system, true, prepared)) return NotApplicable{*reason};
  Int128 above = kOne;
  for (std::size_t i = 0; i < prepared.order.size(); ++i) {
    const Unit &unit = system.units[prepared.order[i]];
    const Int128 own = share(unit.volume, unit.period);
    const Int128 product = times_one_plus(above, own + share(prepared.blocking[i], unit.period));
    if (product > 2 * kOne) {
      return answer(false,
                    figures("product", product, 2 * kOne) + " at '" + system.tasks[unit.tasks.front()].name + "'");
    }
    above = times_one_plus(above, own);
  }
  return answer(true, "every level within its limit");
}

// m workers, full preemption, independent tasks, nothing that holds up a started or ready job but priority.
std::optional<std::string> why_not_global(const System &system) {
  if (auto reason = why_not_directly(system)) return reason;
  // With m = 1 the limits would be 1 and more, which no fixed priorities reach.
  if (system.platform.workers < 2) return "for two workers or more";
  if (!sched::is_static(system.policy)) {
    return std::string("for rate-monotonic priorities; the policy is ") + to_string(system.policy);
  }
  if (system.mode != sched::Preemption::Full) return "for full preemption";
  if (system.has_edges()) return "tasks have predecessors";
  if (!system.groups.empty()) return "tasks share groups";
  for (const SystemDag &dag : system.dags) {
    if (dag.max_active > 0 && dag.tasks.size() > 1) return "DAG '" + dag.name + "' has a max_active";
  }
  for (std::size_t rank = 1; rank < system.by_rank.size(); ++rank) {
    if (system.tasks[system.by_rank[rank]].level == system.tasks[system.by_rank[rank - 1]].level) {
      return "tasks share priority levels";
    }
  }
  return why_not_by_rate(system, *units_by_rank(system));
}

Int128 largest_share(const System &system) {
  Int128 largest = 0;
  for (const Unit &unit : system.units) largest = std::max(largest, share(unit.volume, unit.period));
  return largest;
}

Outcome apply_global_rm_light(const System &system) {
  if (auto reason = why_not_global(system)) return NotApplicable{*reason};
  const Int128 m = system.platform.workers;
  const Int128 utilization = total_share(system);
  const Int128 largest = largest_share(system);
  const bool fits = utilization * (3 * m - 2) <= m * m * kOne && largest * (3 * m - 2) <= m * kOne;
  return answer(fits, figures("U", utilization, m * m * kOne / (3 * m - 2)) + "; " +
                          figures("max U_i", largest, m * kOne / (3 * m - 2)));
}

Outcome apply_global_rm_utilization(const System &system) {
  if (auto reason = why_not_global(system)) return NotApplicable{*reason};
  const Int128 m = system.platform.workers;
  const Int128 utilization = total_share(system);
  const Int128 largest = largest_share(system);
  // The limit falls with u (m >= 2), so that u rounded up is safe.
  const Int128 twice = m * (kOne - largest) + 2 * largest;
  return answer(largest <= kOne && 2 * utilization <= twice, figures("U", utilization, twice / 2));
}

Method make(std::string_view name, std::string_view cite, std::string_view assumptions, std::string_view complexity,
            Outcome (*apply)(const System &)) {
  Method method;
  method.name = name;
  method.subject = Subject::System;
  method.cite = cite;
  method.assumptions = assumptions;
  method.complexity = complexity;
  method.apply = apply;
  return method;
}

constexpr std::string_view kOneWorker =
    "one worker, full preemption, rate-monotonic order, D >= T, no jitter, no blocking; a DAG of one rate counts as "
    "one task with C = volume";
constexpr std::string_view kOneWorkerBlocking =
    "one worker, any preemption, rate-monotonic order, D >= T, no jitter; a DAG of one rate counts as one task with C "
    "= volume";
constexpr std::string_view kGlobal =
    "m >= 2 workers, full preemption, rate-monotonic order, independent tasks, D >= T, no jitter, groups, max_active "
    "or shared levels";

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
              kOneWorker, "O(n^3), a maximum matching", apply_harmonic_chains);
}

Method liu_layland_blocking() {
  return make(
      "liu_layland_blocking",
      "L. Sha, R. Rajkumar, J. Lehoczky, Priority inheritance protocols, IEEE Transactions on Computers 39(9), 1990",
      kOneWorkerBlocking, "O(n^2)", apply_liu_layland_blocking);
}

Method hyperbolic_blocking() {
  return make("hyperbolic_blocking",
              "the hyperbolic bound (Bini, Buttazzo, Buttazzo 2003) with the blocking of Sha, Rajkumar, Lehoczky 1990",
              kOneWorkerBlocking, "O(n^2)", apply_hyperbolic_blocking);
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
