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

// A task in a window of length x that starts when an instant with an idle worker ends.
struct InWindow {
  Duration since = 0;  // how long ago its last job was released
  Duration begun = 0;  // the work of all its jobs if each executes in full
  Duration fresh = 0;  // its work in the window if no earlier job executes in it
};

InWindow in_window(const GlobalUnit &task, Duration x) {
  const Division jobs = divide(x + task.jitter, task);
  const Duration begun = (jobs.quotient + 1) * task.volume;
  return {jobs.remainder, begun, begun - std::max<Duration>(0, task.volume - jobs.remainder)};
}

// How much more it executes with an earlier job, at most C. The earlier job has executed for at least a tick, unless
// jitter can hide its release. The jobs that follow it are released J + C later than the fresh ones. Requires
// J + C <= R <= T.
Duration carried_work(const GlobalUnit &task, const InWindow &in) {
  const Duration wcet = task.volume;
  const Duration most = task.jitter > 0 ? wcet : wcet - 1;
  const Duration into = in.since - (task.jitter + wcet);
  const Duration tail = into + task.response;
  if (into >= 0) return std::clamp<Duration>(tail - task.period, 0, most);
  return std::max({in.fresh, in.begun - wcet + std::min(tail, most), wcet}) - in.fresh;
}

// least_window() of all works.
Duration window_after(std::span<const GlobalUnit> others, Duration d, Duration rest, std::uint32_t workers) {
  Largest largest(workers - 1);
  Duration sum = rest;
  for (const GlobalUnit &other : others) {
    sum += other.work;
    if (other.work >= d) largest.offer(other.work);
  }
  return least_window(sum, largest.entries(), workers);
}

// The next window after `d` if those m - 1 tasks carry work in that have the largest one at `d`.
Duration guan_window(std::span<GlobalUnit> more_urgent, Duration x, Duration d, std::uint32_t workers) {
  Effort::spend(more_urgent.size() + 1);
  const std::size_t carrying = workers - 1;
  const bool all_carry = carrying >= more_urgent.size() || carrying > Largest::kMost;
  Largest most_carried(all_carry ? 0 : carrying);
  for (std::size_t i = 0; i < more_urgent.size(); ++i) {
    GlobalUnit &other = more_urgent[i];
    const InWindow in = in_window(other, x);
    other.work = in.fresh;
    other.carried = carried_work(other, in);
    if (all_carry) other.work += other.carried;
    if (other.work < d) most_carried.offer(std::min(other.carried, d - other.work), i);
  }
  for (const Largest::Entry &entry : most_carried.entries()) {
    if (entry.value > 0) more_urgent[entry.whose].work += more_urgent[entry.whose].carried;
  }
  return window_after(more_urgent, d, 0, workers);
}

// least_window() with `rest` and the sequential_work() of all units in windows of length d.
Duration carrying_window(std::span<GlobalUnit> others, Duration d, Duration rest, std::uint32_t workers) {
  Effort::spend(others.size() + 1);
  for (GlobalUnit &other : others) other.work = sequential_work(other, d);
  return window_after(others, d, rest, workers);
}

// The length from which to search: each other executes for at least min(C, d) in a window of d or more.
Duration first_window(std::span<const GlobalUnit> others, Duration rest, std::uint32_t workers) {
  FirstWindow first(workers, rest);
  for (const GlobalUnit &other : others) first.add(other.volume);
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

bool guan_response(std::span<GlobalUnit> units, std::size_t k, std::uint32_t workers, Duration start) {
  GlobalUnit &own = units[k];
  const Duration stop = own.limit - own.jitter - own.volume + 1;
  const auto window = [&](Duration d) { return d + own.volume - 1; };
  Duration d = std::max(start, first_window(units.first(k), 0, workers));
  const bool found =
      least_fixed_point(stop, d, [&](Duration w) { return guan_window(units.first(k), window(w), w, workers); });
  own.response = window(d) + own.jitter;
  return found;
}

Duration start_again(const GlobalUnit &unit) { return window_of(unit); }

bool sequential_nonpreemptive_response(std::span<GlobalUnit> units, std::size_t k, std::uint32_t workers,
                                       Duration remaining, Duration start) {
  GlobalUnit &own = units[k];
  if (remaining >= kUnbounded / 4) return false;
  Duration d = std::max(start, first_window(units.first(k), remaining, workers));
  const bool found = least_fixed_point(own.limit - own.jitter - own.volume + 1, d, [&](Duration waiting) {
    return carrying_window(units.first(k), waiting, remaining, workers);
  });
  own.response = d - 1 + own.volume + own.jitter;
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
  terms.reserve(k + 5);
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

// An earlier job of the task itself can keep a worker from its equals, and more of them then carry work in. Therefore
// guan() takes no equals.
Outcome apply_guan(const TaskSet &task_set) {
  return from_most_urgent(task_set, {.edges = false}, [](global::Units &view, std::size_t k, bool, Duration &) {
    return global::guan_response(view.units, k, view.workers, global::start_after(view.units, k));
  });
}

Outcome apply_sequential_nonpreemptive(const TaskSet &task_set) {
  return from_most_urgent(task_set, {.mode = sched::Preemption::None, .edges = false, .equals = true},
                          [&task_set](global::Units &view, std::size_t k, bool alone, Duration &remaining) {
                            remaining = global::largest_remaining(task_set, view.units, k + 1, view.workers);
                            const Duration start = alone ? 0 : global::start_again(view.units[k]);
                            return global::sequential_nonpreemptive_response(view.units, k, view.workers, remaining,
                                                                             start);
                          });
}

}  // namespace

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
      .apply = [](const TaskSet &task_set) { return across_rates(task_set, apply_sequential_nonpreemptive); },
  };
}

}  // namespace redag::analysis
