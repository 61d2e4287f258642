// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/many_workers/global_dag.hpp"

#include <utility>

#include "redag_analysis/core/arithmetic.hpp"
#include "redag_analysis/core/effort.hpp"
#include "redag_analysis/core/rate_edges.hpp"
#include "redag_analysis/many_workers/fixed_point.hpp"

namespace redag::analysis {
namespace global {
namespace {

// floor(a / b + c / d) for small divisors.
Duration floor_of_sum(Duration a, Duration b, Duration c, Duration d) {
  return a / b + c / d + (a % b * d + c % d * b) / (b * d);
}

// One window of dag_bounded(), with the works of the more urgent DAGs in it.
class Window {
 public:
  Window(std::span<const GlobalUnit> more_urgent, const GlobalUnit &own, std::uint32_t workers, Duration blocking,
         std::span<Duration> works)
      : more_urgent_(more_urgent), own_(own), workers_(workers), blocking_(blocking), works_(works) {
    // Its other tasks that can execute while the critical path waits and max_active is not reached.
    own_width_ = std::min(own.abreast, own.bound > 0 ? own.bound : own.abreast) - 1;
    // The critical path need not be the longest one. With max_active a shorter one could matter, and all of the volume
    // counts.
    own_work_ = own.bound > 0 ? own.volume : own.volume - own.length;
  }

  Duration next(Duration window) {
    Effort::spend(works_.size() + 1);
    sum_ = 0;
    for (std::size_t i = 0; i < works_.size(); ++i) sum_ += works_[i] = dag_work(more_urgent_[i], window);
    busy_ = busy_instants();
    if (own_.bound == 0) return own_.length + busy_;
    return own_.length + floor_of_sum(own_.volume - own_.length, own_.bound, others_in(busy_), workers_);
  }

  [[nodiscard]] Duration busy() const { return busy_; }

 private:
  // The work of others in `busy` instants: in each, no DAG does more than its width.
  [[nodiscard]] Duration others_in(Duration busy) const {
    Effort::spend(works_.size() + 1);
    Duration sum = busy > 0 ? blocking_ : 0;
    for (std::size_t i = 0; i < works_.size(); ++i) {
      sum += std::min(works_[i], busy * static_cast<Duration>(more_urgent_[i].width));
    }
    return sum;
  }

  // Returns the largest y with m y <= min(V, r y) + sum min(W_j, c_j y) + B. The right-hand side is concave: where y is
  // too large, the line that continues it bounds it from above, and meets m y at or above the result.
  [[nodiscard]] Duration busy_instants() const {
    Duration busy = (own_work_ + sum_ + blocking_) / workers_;
    for (;;) {
      Effort::spend(works_.size() + 1);
      Duration constant = blocking_;
      Duration slope = 0;
      const auto count = [&](Duration work, Duration width) {
        const bool is_whole = work <= width * busy;
        constant += is_whole ? work : 0;
        slope += is_whole ? 0 : width;
      };
      count(own_work_, own_width_);
      for (std::size_t i = 0; i < works_.size(); ++i) count(works_[i], static_cast<Duration>(more_urgent_[i].width));
      if (slope >= workers_ || constant / (workers_ - slope) >= busy) return busy;
      busy = constant / (workers_ - slope);
    }
  }

  std::span<const GlobalUnit> more_urgent_;
  const GlobalUnit &own_;
  Duration workers_;
  Duration blocking_;
  std::span<Duration> works_;
  Duration own_width_ = 0;
  Duration own_work_ = 0;
  Duration sum_ = 0;
  Duration busy_ = 0;
};

}  // namespace

bool bounded_response(std::span<GlobalUnit> units, std::size_t k, std::uint32_t workers, Duration blocking,
                      Waiting &waiting, Duration start) {
  GlobalUnit &own = units[k];
  if (is_hopeless(own, workers) || blocking >= kUnbounded / 4) return false;
  Window window(units.first(k), own, workers, blocking, std::span(waiting.works).first(k));
  waiting.window = std::max(start, own.length);
  const bool found =
      least_fixed_point(own.limit - own.jitter, waiting.window, [&window](Duration x) { return window.next(x); });
  waiting.busy = window.busy();
  own.response = waiting.window + own.jitter;
  return found;
}

Duration blocking_of(const TaskSet &task_set, const std::vector<GlobalUnit> &units, std::size_t k,
                     std::uint32_t workers) {
  const GlobalUnit &own = units[k];
  const Duration first = largest_remaining(task_set, units, k + 1, workers);
  const Duration later = workers > 1 ? largest_remaining(task_set, units, k + 1, workers - 1) : 0;
  // While max_active is reached, less urgent jobs start; each end of a job of the DAG can lead to another wait.
  const std::uint32_t ends = (own.bound > 0 ? own.tasks : own.path_tasks) - 1;
  return add(first, multiply(later, ends));
}

}  // namespace global

namespace {

using global::GlobalUnit;
using global::SharedTerms;

// Sets a response at or below any that is found, and large enough for dag_work().
void start_low(GlobalUnit &unit, std::uint32_t workers) {
  const Duration more = unit.bound > 0           ? (unit.volume - unit.length) / unit.bound
                        : unit.abreast > workers ? (unit.volume - unit.length) / static_cast<Duration>(workers)
                                                 : 0;
  unit.response = unit.length + more + unit.jitter;
}

// Expects `respond(k, start)` and `explain(k, terms)`.
template <class Respond, class Explain>
Bound from_most_urgent(const TaskSet &task_set, global::Units &view, Respond respond, Explain explain) {
  return global::from_most_urgent(
      task_set, view.units, [&view](GlobalUnit &unit) { start_low(unit, view.workers); },
      [&](std::size_t k, bool alone) { return respond(k, alone ? 0 : view.units[k].response - view.units[k].jitter); },
      [&](std::size_t k) {
        ResponseBound bound;
        bound.response = view.units[k].response;
        SharedTerms terms(task_set, view.units[k]);
        terms.add_path();
        if (terms.wanted()) explain(k, terms);
        terms.add_jitter();
        bound.terms = terms.take();
        return bound;
      },
      global::narrows_to_part(task_set), true);
}

// Adds shares of `waiting.busy` or, with max_active, of the sum that made the response. The tightening is taken from
// the terms in their order, such that they add up.
void explain_bounded(std::span<const GlobalUnit> units, std::size_t k, std::uint32_t workers, Duration blocking,
                     const global::Waiting &waiting, SharedTerms &terms) {
  const GlobalUnit &own = units[k];
  const auto at_most = [&](Duration work, Duration width) { return std::min(work, waiting.busy * width); };
  Duration left = own.bound > 0 ? kUnbounded : multiply(waiting.busy, workers);
  const auto share = [&](Term::Kind kind, const GlobalUnit &whose, Duration amount) {
    const Duration taken = std::min(amount, left);
    left -= taken;
    terms.add_share(kind, whose, taken, workers);
  };
  for (std::size_t i = 0; i < k; ++i) {
    share(Term::Kind::Interference, units[i], at_most(waiting.works[i], units[i].width));
  }
  if (waiting.busy > 0) share(Term::Kind::Blocking, own, blocking);
  if (own.bound > 0) {
    terms.add_share(Term::Kind::Own, own, own.volume - own.length, own.bound);
  } else {
    terms.add_share(Term::Kind::Own, own, left, workers);  // the rest is its own other tasks
  }
}

Outcome apply_bounded(const TaskSet &task_set, sched::Preemption mode) {
  global::Units view = global::units_of(task_set, {.mode = mode, .bounds = true, .equals = true});
  if (view.reason) return NotApplicable{*view.reason};
  const std::span<GlobalUnit> units(view.units);
  global::Waiting waiting;
  waiting.works.resize(units.size());
  Duration blocking = 0;
  return from_most_urgent(
      task_set, view,
      [&](std::size_t k, Duration start) {
        if (mode == sched::Preemption::None) blocking = global::blocking_of(task_set, view.units, k, view.workers);
        return global::bounded_response(units, k, view.workers, blocking, waiting, start);
      },
      [&](std::size_t k, SharedTerms &terms) { explain_bounded(units, k, view.workers, blocking, waiting, terms); });
}

// Bounds units[k] below all others: the bound if nothing is known of their order.
class AgainstAll {
 public:
  AgainstAll(const TaskSet &task_set, std::vector<GlobalUnit> &units, std::uint32_t workers)
      : task_set_(task_set), units_(units), workers_(workers) {
    waiting_.works.resize(units.size());
    for (GlobalUnit &unit : units) start_low(unit, workers);
  }

  bool respond(std::size_t k) {
    std::swap(units_[k], units_.back());
    const bool found = respond();
    std::swap(units_[k], units_.back());
    return found;
  }

  // Called once all responses agree.
  ResponseBound explain(std::size_t k) {
    ResponseBound bound;
    bound.response = units_[k].response;
    if (!Effort::itemises(units_[k].unit)) return bound;
    std::swap(units_[k], units_.back());
    (void)respond();
    const GlobalUnit &own = units_.back();
    SharedTerms terms(task_set_, own);
    terms.add_path();
    explain_bounded(units_, units_.size() - 1, workers_, 0, waiting_, terms);
    terms.add_jitter();
    bound.terms = terms.take();
    std::swap(units_[k], units_.back());
    return bound;
  }

 private:
  bool respond() { return global::bounded_response(units_, units_.size() - 1, workers_, 0, waiting_); }

  const TaskSet &task_set_;
  std::vector<GlobalUnit> &units_;
  std::uint32_t workers_;
  global::Waiting waiting_;
};

Outcome apply_dag(const TaskSet &task_set) {
  // A critical path waits only while all workers execute, or as many of its own tasks as max_active allows.
  const auto mode = task_set.mode == sched::Preemption::None ? sched::Preemption::None : sched::Preemption::Full;
  global::Units view = global::units_of(task_set, {.mode = mode, .bounds = true, .any_policy = true});
  if (view.reason) return NotApplicable{*view.reason};
  AgainstAll all(task_set, view.units, view.workers);
  return global::all_that_agree(
      task_set, view.units, "a DAG's response time can reach its next release, and then no other bound holds",
      [&](std::size_t k) { return all.respond(k); }, [&](std::size_t k) { return all.explain(k); });
}

Outcome apply_dag_preemptive(const TaskSet &task_set) { return apply_bounded(task_set, sched::Preemption::Full); }
Outcome apply_dag_nonpreemptive(const TaskSet &task_set) { return apply_bounded(task_set, sched::Preemption::None); }

}  // namespace

Method dag_bounded() {
  return Method{
      .name = "dag_bounded",
      .subject = Subject::Dag,
      .cite =
          "docs/analysis.md, \"Several workers\"; after A. Melani, M. Bertogna, V. Bonifaci, A. Marchetti-Spaccamela, "
          "G. "
          "Buttazzo, ECRTS 2015; of independent tasks: M. Bertogna, M. Cirinei, RTSS 2007",
      .assumptions =
          "m workers, full preemption, static priorities that keep DAGs together, one rate per DAG, R <= T; release "
          "jitter, shared levels, max_active of DAGs in one part; no shared groups",
      .complexity = "pseudo-polynomial; O(DAGs) per step",
      .apply = [](const TaskSet &task_set) { return across_rates(task_set, apply_dag_preemptive); },
  };
}

Method dag_any() {
  return Method{
      .name = "dag_any",
      .subject = Subject::Dag,
      .cite =
          "docs/analysis.md, \"Several workers\"; after A. Melani et al., ECRTS 2015 (global EDF), and M. Bertogna, M. "
          "Cirinei, RTSS 2007",
      .assumptions =
          "m workers, full preemption or none, any work-conserving order (EDF, FIFO, interleaved priorities), one rate "
          "per DAG, R <= T for all; release jitter, shared levels, max_active of DAGs in one part; no shared groups",
      .complexity = "pseudo-polynomial; O(DAGs^2) per step, at most 1000 rounds",
      .apply = apply_dag,
  };
}

Method dag_nonpreemptive() {
  return Method{
      .name = "dag_nonpreemptive",
      .subject = Subject::Dag,
      .cite =
          "docs/analysis.md, \"Several workers\"; after M. Serrano, A. Melani, M. Bertogna, E. Quinones, Response-time "
          "analysis of DAG tasks under fixed priority scheduling with limited preemptions, DATE 2016",
      .assumptions =
          "m workers, jobs run to completion, static priorities that keep DAGs together, one rate per DAG, R <= T; "
          "release jitter, equal priorities, max_active of DAGs in one part; no shared groups",
      .complexity = "pseudo-polynomial; O(DAGs) per step",
      .apply = [](const TaskSet &task_set) { return across_rates(task_set, apply_dag_nonpreemptive); },
  };
}

}  // namespace redag::analysis
