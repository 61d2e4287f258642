#include "redag/analysis/global_sequential.hpp"

#include <algorithm>
#include <array>

#include "redag/analysis/arithmetic.hpp"

namespace redag::analysis {
namespace global {
namespace {

// Least fixed point of a monotone `next` that is at least `start`, or nothing above `stop`.
template <class Next>
bool least_fixed_point(Duration start, Duration stop, Duration &result, Next next) {
  Duration x = start;
  for (int steps = 0; x <= stop && steps < kMaxSteps; ++steps) {
    const Duration y = next(x);
    if (y <= x) {
      result = x;
      return true;
    }
    x = y;
  }
  return false;
}

// The `kept` largest of the values offered; a few workers need a few.
class Largest {
 public:
  explicit Largest(std::uint32_t kept) : kept_(kept) {}
  void offer(Duration value) {
    if (value <= smallest_) return;
    std::size_t i = kept_ - 1;
    for (; i > 0 && values_[i - 1] < value; --i) values_[i] = values_[i - 1];
    values_[i] = value;
    smallest_ = values_[kept_ - 1];
  }
  [[nodiscard]] Duration sum() const {
    Duration total = 0;
    for (std::size_t i = 0; i < kept_; ++i) total += values_[i];
    return total;
  }
  static constexpr std::size_t kMost = 64;

 private:
  std::size_t kept_;
  Duration smallest_ = 0;
  std::array<Duration, kMost> values_{};
};

// A task's work in a window that starts when an instant with an idle worker ends: without a job from before, and by how
// much more with one. A job from before has executed for at least a tick, unless jitter can hide its release.
struct Work {
  Duration fresh = 0;
  Duration more = 0;
};

Work guan_work(const GlobalUnit &task, Duration x, Duration most) {
  const Duration wcet = task.volume;
  const Division jobs = divide(x + task.jitter, task);
  const Duration fresh = std::min(most, jobs.quotient * wcet + std::min(wcet, jobs.remainder));
  Duration carried = wcet;
  if (x > wcet) {
    const Division before = divide(x - wcet, task);
    const Duration tail = std::max<Duration>(0, before.remainder - (task.period - task.response));
    carried = (before.quotient + 1) * wcet + std::min(tail, task.jitter > 0 ? wcet : wcet - 1);
  }
  return Work{fresh, std::max<Duration>(0, std::min(most, carried) - fresh)};
}

// Sum of interference of the more urgent tasks in a window of length x.
Duration guan_interference(std::span<const GlobalUnit> more_urgent, Duration x, Duration most, std::uint32_t workers) {
  Duration sum = 0;
  if (workers - 1 >= more_urgent.size() || workers > Largest::kMost) {
    for (const GlobalUnit &other : more_urgent) {
      const Work work = guan_work(other, x, most);
      sum += work.fresh + (workers > 1 ? work.more : 0);
    }
    return sum;
  }
  if (workers == 1) {
    for (const GlobalUnit &other : more_urgent) sum += guan_work(other, x, most).fresh;
    return sum;
  }
  Largest largest(workers - 1);
  for (const GlobalUnit &other : more_urgent) {
    const Work work = guan_work(other, x, most);
    sum += work.fresh;
    largest.offer(work.more);
  }
  return sum + largest.sum();
}

}  // namespace

bool bertogna_cirinei_response(std::span<GlobalUnit> units, std::size_t k, std::uint32_t workers) {
  GlobalUnit &own = units[k];
  Duration window = 0;
  const auto more_urgent = units.first(k);
  const bool found = least_fixed_point(own.volume, own.limit - own.jitter, window, [&](Duration x) {
    Duration sum = 0;
    for (const GlobalUnit &other : more_urgent) sum += std::min(sequential_work(other, x), x - own.volume + 1);
    return own.volume + sum / workers;
  });
  own.response = window + own.jitter;
  return found;
}

bool guan_response(std::span<GlobalUnit> units, std::size_t k, std::uint32_t workers) {
  GlobalUnit &own = units[k];
  Duration window = 0;
  const bool found = least_fixed_point(own.volume, own.limit - own.jitter, window, [&](Duration x) {
    return own.volume + guan_interference(units.first(k), x, x - own.volume + 1, workers) / workers;
  });
  own.response = window + own.jitter;
  return found;
}

bool sequential_nonpreemptive_response(std::span<GlobalUnit> units, std::size_t k, std::uint32_t workers,
                                       Duration remaining) {
  GlobalUnit &own = units[k];
  if (remaining >= kUnbounded / 4) return false;
  const auto more_urgent = units.first(k);
  Duration start = 0;
  const bool found = least_fixed_point(0, own.limit - own.jitter - own.volume, start, [&](Duration s) {
    Duration sum = remaining;
    for (const GlobalUnit &other : more_urgent) sum += sequential_work(other, s + 1);
    return sum / workers;
  });
  own.response = start + own.volume + own.jitter;
  return found;
}

}  // namespace global

namespace {

using global::GlobalUnit;
using global::SharedTerms;

// Interference terms of one fixed point: work of each more urgent task, divided by the workers.
template <class Amount>
ResponseBound itemise(const System &system, std::span<const GlobalUnit> units, std::size_t k, std::uint32_t workers,
                      Duration remaining, Amount amount) {
  const GlobalUnit &own = units[k];
  ResponseBound bound;
  bound.response = own.response;
  SharedTerms terms(system, own);
  terms.add_path();
  terms.add_jitter();
  if (remaining > 0) terms.add_share(Term::Kind::Blocking, own, remaining, workers);
  for (std::size_t i = 0; i < k; ++i) terms.add_share(Term::Kind::Interference, units[i], amount(units[i]), workers);
  bound.terms = terms.take();
  return bound;
}

template <class Respond, class Explain>
Bound from_most_urgent(const System &system, global::Units &view, Respond respond, Explain explain) {
  std::vector<ResponseBound> responses(system.units.size());
  bool known = true;
  for (std::size_t k = 0; k < view.units.size(); ++k) {
    ResponseBound &response = responses[view.units[k].unit];
    if (!known) {
      response.absent = global::kMoreUrgent;
    } else if (respond(k)) {
      response = explain(k);
    } else {
      known = false;
      response.absent = global::kExceedsLimit;
    }
  }
  return from_units(system, std::move(responses));
}

Outcome apply_bertogna_cirinei(const System &system) {
  global::Units view = global::units_of(system, {.edges = false});
  if (view.reason) return NotApplicable{*view.reason};
  const std::span<GlobalUnit> units(view.units);
  return from_most_urgent(
      system, view, [&](std::size_t k) { return global::bertogna_cirinei_response(units, k, view.workers); },
      [&](std::size_t k) {
        const Duration x = units[k].response - units[k].jitter;
        return itemise(system, units, k, view.workers, 0, [&](const GlobalUnit &other) {
          return std::min(global::sequential_work(other, x), x - units[k].volume + 1);
        });
      });
}

Outcome apply_guan(const System &system) {
  global::Units view = global::units_of(system, {.edges = false});
  if (view.reason) return NotApplicable{*view.reason};
  const std::span<GlobalUnit> units(view.units);
  std::vector<std::size_t> order;
  std::vector<bool> carries(units.size());
  return from_most_urgent(
      system, view, [&](std::size_t k) { return global::guan_response(units, k, view.workers); },
      [&](std::size_t k) {
        const Duration x = units[k].response - units[k].jitter;
        const Duration most = x - units[k].volume + 1;
        const auto work = [&](std::size_t i) { return global::guan_work(units[i], x, most); };
        order.resize(k);
        for (std::size_t i = 0; i < k; ++i) order[i] = i;
        const std::size_t carried = std::min<std::size_t>(k, view.workers - 1);
        std::partial_sort(order.begin(), order.begin() + static_cast<std::ptrdiff_t>(carried), order.end(),
                          [&](std::size_t a, std::size_t b) { return work(a).more > work(b).more; });
        std::fill(carries.begin(), carries.end(), false);
        for (std::size_t i = 0; i < carried; ++i) carries[order[i]] = true;
        return itemise(system, units, k, view.workers, 0, [&](const GlobalUnit &other) {
          const auto i = static_cast<std::size_t>(&other - units.data());
          return work(i).fresh + (carries[i] ? work(i).more : 0);
        });
      });
}

Outcome apply_nonpreemptive(const System &system) {
  global::Units view = global::units_of(system, {.mode = sched::Preemption::None, .edges = false});
  if (view.reason) return NotApplicable{*view.reason};
  const std::span<GlobalUnit> units(view.units);
  Duration remaining = 0;
  return from_most_urgent(
      system, view,
      [&](std::size_t k) {
        remaining = global::largest_remaining(system, view.units, k + 1, view.workers);
        return global::sequential_nonpreemptive_response(units, k, view.workers, remaining);
      },
      [&](std::size_t k) {
        const Duration start = units[k].response - units[k].jitter - units[k].volume;
        return itemise(system, units, k, view.workers, remaining,
                       [&](const GlobalUnit &other) { return global::sequential_work(other, start + 1); });
      });
}

// One round over all tasks with the responses of the last; false: some task has none, so nothing is known of any.
bool refine_any(std::span<GlobalUnit> units, std::uint32_t workers, bool &changed) {
  changed = false;
  for (std::size_t k = 0; k < units.size(); ++k) {
    GlobalUnit &own = units[k];
    Duration window = own.volume;
    int steps = 0;
    for (;; ++steps) {
      if (window > own.limit - own.jitter || steps >= global::kMaxSteps) return false;
      Duration sum = 0;
      for (std::size_t i = 0; i < units.size(); ++i) {
        if (i != k) sum += std::min(global::sequential_work(units[i], window), window - own.volume + 1);
      }
      const Duration next = own.volume + sum / workers;
      if (next <= window) break;
      window = next;
    }
    changed = changed || window + own.jitter < own.response;
    own.response = std::min(own.response, window + own.jitter);
  }
  return true;
}

Outcome apply_any(const System &system) {
  // A job waits only while all workers execute others, whether those can be preempted or not.
  const auto mode = system.mode == sched::Preemption::None ? sched::Preemption::None : sched::Preemption::Full;
  global::Units view = global::units_of(system, {.mode = mode, .edges = false, .any_policy = true});
  if (view.reason) return NotApplicable{*view.reason};
  const std::span<GlobalUnit> units(view.units);
  for (GlobalUnit &unit : units) unit.response = unit.limit;  // as if; holds if every task keeps its limit
  constexpr int kRounds = 50;
  bool changed = true;
  for (int round = 0; round < kRounds && changed; ++round) {
    if (refine_any(units, view.workers, changed)) continue;
    ResponseBound none;
    none.absent = "some task's response can exceed its limit, which all others rely on";
    return from_units(system, std::vector<ResponseBound>(system.units.size(), none));
  }
  std::vector<ResponseBound> responses(system.units.size());
  for (const GlobalUnit &unit : units) {
    ResponseBound &response = responses[unit.unit];
    response.response = unit.response;
    SharedTerms terms(system, unit);
    terms.add_path();
    terms.add_jitter();
    terms.add(Term::Kind::Interference, unit, unit.response - unit.jitter - unit.volume);
    response.terms = terms.take();
    for (Term &term : response.terms) {
      if (term.kind == Term::Kind::Interference) term.task = TaskId(), term.dag = DagId();
    }
  }
  return from_units(system, std::move(responses));
}

}  // namespace

Method bertogna_cirinei() {
  Method method;
  method.name = "bertogna_cirinei";
  method.cite =
      "M. Bertogna, M. Cirinei, Response-time analysis for globally scheduled symmetric multiprocessor platforms, "
      "RTSS 2007";
  method.assumptions =
      "m workers, full preemption, static priorities, no edges, R <= T; release jitter; no shared groups or levels";
  method.complexity = "pseudo-polynomial; O(n) a step";
  method.apply = apply_bertogna_cirinei;
  return method;
}

Method bertogna_cirinei_any() {
  Method method = bertogna_cirinei();
  method.name = "bertogna_cirinei_any";
  method.assumptions =
      "m workers, full preemption or none, any work-conserving order (EDF, FIFO too), no edges, R <= T for all tasks; "
      "release jitter, shared levels; no shared groups";
  method.complexity = "pseudo-polynomial; O(n^2) a step, at most 50 rounds";
  method.apply = apply_any;
  return method;
}

Method guan() {
  Method method;
  method.name = "guan";
  method.cite =
      "N. Guan, M. Stigge, W. Yi, G. Yu, New response time bounds for fixed priority multiprocessor scheduling, RTSS "
      "2009";
  method.assumptions =
      "m workers, full preemption, static priorities, no edges, R <= T; release jitter; no shared groups or levels";
  method.complexity = "pseudo-polynomial; O(n m) a step";
  method.apply = apply_guan;
  return method;
}

Method sequential_nonpreemptive() {
  Method method;
  method.name = "sequential_nonpreemptive";
  method.cite = "docs/analysis.md, \"Several workers\"; after N. Guan, W. Yi, Z. Gu, Q. Deng, G. Yu, RTSS 2008";
  method.assumptions =
      "m workers, jobs run to completion, static priorities, no edges, R <= T; release jitter; no shared groups";
  method.complexity = "pseudo-polynomial; O(n) a step";
  method.apply = apply_nonpreemptive;
  return method;
}

}  // namespace redag::analysis
