// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/many_workers/global_sequential.hpp"

#include <algorithm>

#include "redag_analysis/core/arithmetic.hpp"
#include "redag_analysis/core/effort.hpp"
#include "redag_analysis/core/rate_edges.hpp"
#include "redag_analysis/many_workers/fixed_point.hpp"
#include "redag_analysis/many_workers/waiting_window.hpp"

namespace redag::analysis {
namespace global {
namespace {

// A task's work in a window that starts when an instant with an idle worker ends, without an earlier job and with one.
// An earlier job has executed for at least a tick, unless jitter can hide its release.
struct Work {
  Duration fresh = 0;
  Duration carried = 0;
};

Work guan_work(const GlobalUnit &task, Duration x) {
  const Duration wcet = task.volume;
  const Division jobs = divide(x + task.jitter, task);
  const Duration fresh = jobs.quotient * wcet + std::min(wcet, jobs.remainder);
  // floor and remainder of (x - C) / T without another division; J + C <= R <= T.
  const Duration into = jobs.remainder - (task.jitter + wcet);
  const Duration whole = into < 0 ? jobs.quotient : jobs.quotient + 1;
  const Duration last = into < 0 ? into + task.period : into;
  const Duration tail = std::max<Duration>(0, last - (task.period - task.response));
  const Duration carried = whole * wcet + std::min(tail, task.jitter > 0 ? wcet : wcet - 1);
  return Work{fresh, std::max({fresh, carried, wcet})};
}

// least_window() if the m - 1 tasks with the largest carried work at `d` carry it in.
Duration guan_window(std::span<GlobalUnit> more_urgent, Duration x, Duration d, std::uint32_t workers) {
  Effort::spend(more_urgent.size() + 1);
  const std::size_t carrying = workers - 1;
  const bool all_carry = carrying >= more_urgent.size() || carrying > Largest::kMost;
  Largest most_carried(all_carry ? 0 : carrying);
  for (std::size_t i = 0; i < more_urgent.size(); ++i) {
    GlobalUnit &other = more_urgent[i];
    const Work work = guan_work(other, x);
    other.work = all_carry && carrying > 0 ? work.carried : work.fresh;
    other.carried = work.carried;
    if (!all_carry) most_carried.offer(std::min(work.carried, d) - std::min(work.fresh, d), i);
  }
  for (const Largest::Entry &entry : most_carried.entries()) {
    if (entry.value > 0) more_urgent[entry.whose].work = more_urgent[entry.whose].carried;
  }
  Largest largest(carrying);
  Duration sum = 0;
  for (const GlobalUnit &other : more_urgent) {
    sum += other.work;
    if (other.work >= d) largest.offer(other.work);  // smaller work is never cut: the result is at least d
  }
  return least_window(sum, largest.entries(), workers);
}

// least_window() if no task carries work in: not above guan_window(), and cheaper.
Duration fresh_window(std::span<const GlobalUnit> more_urgent, Duration x, Duration d, std::uint32_t workers) {
  Effort::spend(more_urgent.size() + 1);
  Largest largest(workers - 1);
  Duration sum = 0;
  for (const GlobalUnit &other : more_urgent) {
    const Division jobs = divide(x + other.jitter, other);
    const Duration work = jobs.quotient * other.volume + std::min(other.volume, jobs.remainder);
    sum += work;
    if (work >= d) largest.offer(work);
  }
  return least_window(sum, largest.entries(), workers);
}

// least_window() with `rest` and the sequential_work() of all units but `skip`.
Duration carrying_window(std::span<GlobalUnit> others, std::size_t skip, Duration x, Duration d, Duration rest,
                         std::uint32_t workers) {
  Effort::spend(others.size() + 1);
  Largest largest(workers - 1);
  Duration sum = rest;
  for (std::size_t i = 0; i < others.size(); ++i) {
    if (i == skip) continue;
    others[i].work = sequential_work(others[i], x);
    sum += others[i].work;
    if (others[i].work >= d) largest.offer(others[i].work);
  }
  return least_window(sum, largest.entries(), workers);
}

constexpr std::size_t kNobody = SIZE_MAX;

// The length from which to search: each other executes for at least min(C, d) in a window of d or more.
Duration first_window(std::span<const GlobalUnit> others, std::size_t skip, Duration rest, std::uint32_t workers) {
  FirstWindow first(workers, rest);
  for (std::size_t i = 0; i < others.size(); ++i) {
    if (i != skip) first.add(others[i].volume);
  }
  return first.length();
}

Duration window_of(const GlobalUnit &unit) { return unit.response - unit.jitter - unit.volume + 1; }

}  // namespace

Duration start_after(std::span<const GlobalUnit> units, std::size_t k) {
  Duration start = 0;
  for (const GlobalUnit &other : units.first(k)) {
    if (other.volume <= units[k].volume) start = std::max(start, window_of(other));
  }
  return start;
}

bool bertogna_cirinei_response(std::span<GlobalUnit> units, std::size_t k, std::uint32_t workers, Duration start) {
  GlobalUnit &own = units[k];
  Duration d = std::max(start, first_window(units.first(k), kNobody, 0, workers));
  const bool found = least_fixed_point(own.limit - own.jitter - own.volume + 1, d, [&](Duration waiting) {
    return carrying_window(units.first(k), kNobody, waiting + own.volume - 1, waiting, 0, workers);
  });
  own.response = d - 1 + own.volume + own.jitter;
  return found;
}

bool guan_response(std::span<GlobalUnit> units, std::size_t k, std::uint32_t workers, Duration start) {
  GlobalUnit &own = units[k];
  const Duration stop = own.limit - own.jitter - own.volume + 1;
  const auto window = [&](Duration d) { return d + own.volume - 1; };
  Duration d = std::max(start, first_window(units.first(k), kNobody, 0, workers));
  const bool found =
      least_fixed_point(stop, d, [&](Duration w) { return fresh_window(units.first(k), window(w), w, workers); }) &&
      least_fixed_point(stop, d, [&](Duration w) { return guan_window(units.first(k), window(w), w, workers); });
  own.response = window(d) + own.jitter;
  return found;
}

Duration start_again(const GlobalUnit &unit) { return window_of(unit); }

bool sequential_nonpreemptive_response(std::span<GlobalUnit> units, std::size_t k, std::uint32_t workers,
                                       Duration remaining, Duration start) {
  GlobalUnit &own = units[k];
  if (remaining >= kUnbounded / 4) return false;
  Duration d = std::max(start, first_window(units.first(k), kNobody, remaining, workers));
  const bool found = least_fixed_point(own.limit - own.jitter - own.volume + 1, d, [&](Duration waiting) {
    return carrying_window(units.first(k), kNobody, waiting, waiting, remaining, workers);
  });
  own.response = d - 1 + own.volume + own.jitter;
  return found;
}

bool any_order_response(std::span<GlobalUnit> units, std::size_t k, std::uint32_t workers) {
  GlobalUnit &own = units[k];
  Duration d = first_window(units, k, 0, workers);
  const bool found = least_fixed_point(own.limit - own.jitter - own.volume + 1, d, [&](Duration waiting) {
    return carrying_window(units, k, waiting + own.volume - 1, waiting, 0, workers);
  });
  if (found) own.response = std::min(own.response, d - 1 + own.volume + own.jitter);
  return found;
}

}  // namespace global

namespace {

using global::GlobalUnit;
using global::SharedTerms;

// Lists the interference terms of one fixed point, whose last step left the work of each more urgent task in `work`.
ResponseBound itemise(const TaskSet &task_set, std::span<const GlobalUnit> units, std::size_t k, std::uint32_t workers,
                      Duration remaining) {
  const GlobalUnit &own = units[k];
  ResponseBound bound;
  bound.response = own.response;
  SharedTerms terms(task_set, own);
  terms.add_path();
  terms.add_jitter();
  if (!terms.wanted()) return bound;
  const Duration waiting = global::window_of(own);
  if (remaining > 0) terms.add_share(Term::Kind::Blocking, own, remaining, workers);
  for (std::size_t i = 0; i < k; ++i) {
    terms.add_share(Term::Kind::Interference, units[i], std::min(units[i].work, waiting), workers);
  }
  bound.terms = terms.take();
  // With very many workers the fixed point need not be the least one.
  Duration sum = 0;
  for (const Term &term : bound.terms) sum += term.amount;
  if (sum < own.response) {
    bound.terms.push_back(Term{Term::Kind::Interference, TaskId(), DagId(), own.response - sum, 0});
  }
  return bound;
}

// `respond(units, k, alone, remaining)` says whether units[k] has a response, and may set `remaining`, its less urgent
// work (0 by default).
template <class Respond>
Outcome from_most_urgent(const TaskSet &task_set, const global::Needs &needs, Respond respond) {
  global::Units view = global::units_of(task_set, needs);
  if (view.reason) return NotApplicable{*view.reason};
  Duration remaining = 0;
  return global::from_most_urgent(
      task_set, view.units, [](GlobalUnit &unit) { unit.response = unit.volume + unit.jitter; },
      [&](std::size_t k, bool alone) { return respond(view, k, alone, remaining); },
      [&](std::size_t k) { return itemise(task_set, view.units, k, view.workers, remaining); });
}

Outcome apply_bertogna_cirinei(const TaskSet &task_set) {
  return from_most_urgent(
      task_set, {.edges = false, .equals = true}, [](global::Units &view, std::size_t k, bool alone, Duration &) {
        const Duration start = alone ? global::start_after(view.units, k) : global::start_again(view.units[k]);
        return global::bertogna_cirinei_response(view.units, k, view.workers, start);
      });
}

// An earlier job of the task itself can keep a worker from its equals, and more of them then carry work in. Therefore
// guan() takes no equals.
Outcome apply_guan(const TaskSet &task_set) {
  return from_most_urgent(task_set, {.edges = false}, [](global::Units &view, std::size_t k, bool, Duration &) {
    return global::guan_response(view.units, k, view.workers, global::start_after(view.units, k));
  });
}

Outcome apply_nonpreemptive(const TaskSet &task_set) {
  return from_most_urgent(task_set, {.mode = sched::Preemption::None, .edges = false, .equals = true},
                          [&task_set](global::Units &view, std::size_t k, bool alone, Duration &remaining) {
                            remaining = global::largest_remaining(task_set, view.units, k + 1, view.workers);
                            const Duration start = alone ? 0 : global::start_again(view.units[k]);
                            return global::sequential_nonpreemptive_response(view.units, k, view.workers, remaining,
                                                                             start);
                          });
}

ResponseBound any_order_bound(const TaskSet &task_set, const GlobalUnit &unit) {
  ResponseBound bound;
  bound.response = unit.response;
  SharedTerms terms(task_set, unit);
  terms.add_path();
  terms.add_jitter();
  bound.terms = terms.take();
  const Duration others = unit.response - unit.jitter - unit.volume;
  if (others > 0 && terms.wanted()) bound.terms.push_back(Term{Term::Kind::Interference, TaskId(), DagId(), others, 0});
  return bound;
}

Outcome apply_any(const TaskSet &task_set) {
  // A job waits only while all workers execute others, whether those can be preempted or not.
  const auto mode = task_set.mode == sched::Preemption::None ? sched::Preemption::None : sched::Preemption::Full;
  global::Units view = global::units_of(task_set, {.mode = mode, .edges = false, .any_policy = true});
  if (view.reason) return NotApplicable{*view.reason};
  // At first every task is assumed to keep its limit. If the first round confirms this for all, it holds, and each
  // further round may rely on the last one. The first job ever to break a bound would have to come after another such
  // job.
  for (GlobalUnit &unit : view.units) unit.response = unit.limit;
  constexpr int kRounds = 50;
  bool possible = !global::is_any_hopeless(view.units, view.workers);
  bool changed = possible;
  for (int round = 0; round < kRounds && changed; ++round) {
    changed = false;
    for (std::size_t k = 0; k < view.units.size() && possible; ++k) {
      const Duration before = view.units[k].response;
      possible = global::any_order_response(view.units, k, view.workers);
      changed = changed || view.units[k].response < before;
    }
  }
  if (!possible) {
    ResponseBound none;
    none.absent = "a task's response time can exceed its limit, on which the bounds of all others rely";
    return from_units(task_set, std::vector<ResponseBound>(task_set.units.size(), none));
  }
  std::vector<ResponseBound> responses(task_set.units.size());
  for (const GlobalUnit &unit : view.units) responses[unit.unit] = any_order_bound(task_set, unit);
  return from_units(task_set, std::move(responses));
}

}  // namespace

Method bertogna_cirinei() {
  return Method{
      .name = "bertogna_cirinei",
      .cite =
          "M. Bertogna, M. Cirinei, Response-time analysis for globally scheduled symmetric multiprocessor platforms, "
          "RTSS 2007",
      .assumptions =
          "m workers, full preemption, static priorities, no edges, R <= T; release jitter, shared levels; no shared "
          "groups",
      .complexity = "pseudo-polynomial; O(n) per step",
      .apply = [](const TaskSet &task_set) { return across_rates(task_set, apply_bertogna_cirinei); },
  };
}

Method bertogna_cirinei_any() {
  Method method = bertogna_cirinei();
  method.name = "bertogna_cirinei_any";
  method.assumptions =
      "m workers, full preemption or none, any work-conserving order (EDF, FIFO too), no edges, R <= T for all tasks; "
      "release jitter, shared levels; no shared groups";
  method.complexity = "pseudo-polynomial; O(n^2) per step, at most 50 rounds";
  method.apply = apply_any;
  return method;
}

Method guan() {
  return Method{
      .name = "guan",
      .cite =
          "N. Guan, M. Stigge, W. Yi, G. Yu, New response time bounds for fixed priority multiprocessor scheduling, "
          "RTSS 2009",
      .assumptions =
          "m workers, full preemption, static priorities, no edges, R <= T; release jitter; no shared groups or levels",
      .complexity = "pseudo-polynomial; O(n m) per step",
      .apply = [](const TaskSet &task_set) { return across_rates(task_set, apply_guan); },
  };
}

Method sequential_nonpreemptive() {
  return Method{
      .name = "sequential_nonpreemptive",
      .cite = "docs/analysis.md, \"Several workers\"; after N. Guan, W. Yi, Z. Gu, Q. Deng, G. Yu, RTSS 2008",
      .assumptions =
          "m workers, jobs run to completion, static priorities, no edges, R <= T; release jitter, equal priorities; "
          "no "
          "shared groups",
      .complexity = "pseudo-polynomial; O(n) per step",
      .apply = [](const TaskSet &task_set) { return across_rates(task_set, apply_nonpreemptive); },
  };
}

}  // namespace redag::analysis
