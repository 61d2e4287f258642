// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/search/audsley.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <tuple>
#include <utility>

#include "redag/base/check.hpp"
#include "redag_analysis/core/arithmetic.hpp"
#include "redag_analysis/many_workers/global_dag.hpp"
#include "redag_analysis/many_workers/global_sequential.hpp"
#include "redag_analysis/one_worker/response_time.hpp"

namespace redag::lab {
namespace {

namespace global = analysis::global;
using global::GlobalUnit;

Duration due_of(const analysis::Unit &unit) { return std::min(unit.deadline, unit.limit); }

template <class Key>
UnitOrder sorted_by(const analysis::TaskSet &task_set, Key key) {
  UnitOrder order(task_set.units.size());
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(),
                   [&](std::uint32_t a, std::uint32_t b) { return key(task_set.units[a]) < key(task_set.units[b]); });
  return order;
}

const std::vector<analysis::Method> &one_worker_methods() {
  static const std::vector<analysis::Method> kMethods = {
      analysis::rta_preemptive(), analysis::rta_nonpreemptive(), analysis::rta_deferred(),
      analysis::dag_one_worker_preemptive(), analysis::dag_one_worker_deferred()};
  return kMethods;
}

// One worker: the fixed points depend only on the set of more urgent units. A unit that moves up past another is
// blocked by at most C - 1 of it, and before had at least C of interference from it.
std::optional<Duration> one_worker_response(const analysis::TaskSet &task_set, std::uint32_t unit) {
  std::optional<Duration> best;
  for (const analysis::Method &method : one_worker_methods()) {
    const analysis::Outcome outcome = method.apply(task_set);
    const analysis::Bound *bound = std::get_if<analysis::Bound>(&outcome);
    if (bound == nullptr) continue;
    Duration found = 0;
    for (const std::uint32_t t : task_set.units[unit].tasks) {
      found = std::max(found, bound->tasks[t].response.value_or(kNever));
    }
    if (found < best.value_or(kNever)) best = found;
  }
  return best;
}

// Several workers: the fixed points of the bounds, with each more urgent unit's deadline in place of its response. Work
// in a window only grows with a response, and the order among the more urgent units no longer matters.
std::optional<Duration> global_response(const analysis::TaskSet &task_set, std::uint32_t unit) {
  const bool edges = task_set.has_edges();
  const bool bounds = std::any_of(task_set.dags.begin(), task_set.dags.end(),
                                  [](const analysis::CompiledDag &dag) { return dag.max_active > 0; });
  const bool sequential = !edges && !bounds;
  global::Units view = global::units_of(task_set, {.mode = task_set.mode, .edges = !sequential, .bounds = !sequential});
  if (view.reason) return std::nullopt;
  const auto own = std::find_if(view.units.begin(), view.units.end(),
                                [&](const GlobalUnit &candidate) { return candidate.unit == unit; });
  const auto k = static_cast<std::size_t>(own - view.units.begin());
  for (std::size_t i = 0; i < k; ++i) {
    GlobalUnit &other = view.units[i];
    const Duration least = other.jitter + other.volume;  // the least response that the workload formulas allow
    if (least > other.period) return std::nullopt;
    other.response = std::clamp(due_of(task_set.units[other.unit]), least, other.period);
  }
  const std::span<GlobalUnit> units(view.units);
  bool found = false;
  if (sequential) {
    found = task_set.mode == sched::Preemption::Full
                ? global::guan_response(units, k, view.workers)
                : global::sequential_nonpreemptive_response(
                      units, k, view.workers, global::largest_remaining(task_set, view.units, k + 1, view.workers));
  } else {
    const Duration blocking =
        task_set.mode == sched::Preemption::Full ? 0 : global::blocking_of(task_set, view.units, k, view.workers);
    global::Waiting waiting;
    waiting.works.resize(units.size());
    found = global::bounded_response(units, k, view.workers, blocking, waiting);
  }
  if (!found) return std::nullopt;
  return units[k].response;
}

// Compiles the workload with priorities in this order. It compiled before and cannot fail now.
analysis::TaskSet compiled(const Workload &workload, const analysis::AnalysisPlatform &platform,
                           const analysis::TaskSet &before, const UnitOrder &order) {
  Result<analysis::TaskSet> task_set = analysis::compile(with_order(workload, before, order), platform);
  REDAG_CHECK(task_set.has_value(), "other priorities make a valid workload invalid");
  return *std::move(task_set);
}

}  // namespace

Workload with_order(const Workload &workload, const analysis::TaskSet &task_set, const UnitOrder &order) {
  std::vector<int> priority(task_set.tasks.size(), 0);
  for (std::size_t place = 0; place < order.size(); ++place) {
    for (const std::uint32_t t : task_set.units[order[place]].tasks) {
      priority[t] = static_cast<int>(order.size() - place);
    }
  }
  Workload result = workload;
  result.policy = PolicyKind::Fixed;
  std::size_t t = 0;
  for (Dag &dag : result.dags) {
    for (Task &task : dag.tasks) task.priority = priority[t++];
  }
  return result;
}

UnitOrder present_order(const analysis::TaskSet &task_set) {
  return sorted_by(task_set, [](const analysis::Unit &unit) { return unit.first_rank; });
}

UnitOrder deadline_order(const analysis::TaskSet &task_set) {
  return sorted_by(task_set, [](const analysis::Unit &unit) { return std::tuple(due_of(unit), unit.period); });
}

UnitOrder dkc_order(const analysis::TaskSet &task_set) {
  const double m = task_set.platform.workers;
  const double k = (m - 1 + std::sqrt(5 * m * m - 6 * m + 1)) / (2 * m);
  return sorted_by(task_set, [k](const analysis::Unit &unit) {
    return static_cast<double>(due_of(unit)) - k * static_cast<double>(unit.length);
  });
}

TestChoice order_free_test(const Workload &workload, const analysis::AnalysisPlatform &platform) {
  const Result<analysis::TaskSet> before = analysis::compile(workload, platform);
  if (!before) return {std::nullopt, before.error().front().message};
  if (!before->not_analysable.empty()) return {std::nullopt, before->not_analysable};
  const analysis::TaskSet task_set = compiled(workload, platform, *before, deadline_order(*before));
  OrderFreeTest test;
  if (platform.workers == 1) {
    // Which method applies does not depend on the order. With shared levels, a bound depends on which units share a
    // level.
    std::string why;
    for (const analysis::Method &method : one_worker_methods()) {
      const analysis::Outcome outcome = method.apply(task_set);
      if (std::holds_alternative<analysis::Bound>(outcome)) {
        test = {std::string(method.name), platform.levels == 0, one_worker_response};
        return {std::move(test), {}};
      }
      if (why.empty()) why = std::get<analysis::NotApplicable>(outcome).reason;
    }
    return {std::nullopt, why};
  }
  const bool full = task_set.mode == sched::Preemption::Full;
  if (task_set.mode == sched::Preemption::Cooperative) {
    return {std::nullopt, "no bound for several workers covers cooperative preemption"};
  }
  const global::Units view = global::units_of(task_set, {.mode = task_set.mode, .bounds = true});
  if (view.reason) return {std::nullopt, *view.reason};
  // Without preemption, a unit that moves up past a long one can wait longer for it than before: its deadline may let
  // in less than C - 1 of interference. Optimality is therefore not claimed there.
  const bool edges = task_set.has_edges();
  test.name = full ? (edges ? "dag_bounded with deadlines for responses" : "guan with deadlines for responses")
                   : (edges ? "dag_nonpreemptive with deadlines for responses"
                            : "sequential_nonpreemptive with deadlines for responses");
  test.optimal = full;
  test.response = global_response;
  return {std::move(test), {}};
}

std::optional<UnitOrder> audsley(const Workload &workload, const analysis::AnalysisPlatform &platform,
                                 const OrderFreeTest &test, const Badness &badness, const std::function<bool()> &stop) {
  const Result<analysis::TaskSet> before = analysis::compile(workload, platform);
  REDAG_CHECK(before.has_value(), "audsley() needs a valid workload");
  UnitOrder open = deadline_order(*before);
  UnitOrder placed;
  while (!open.empty()) {
    std::optional<std::size_t> best;
    double least_late = 0;
    // Begins with the longest deadline, which gets the place among equally late units.
    for (std::size_t i = open.size(); i-- > 0;) {
      if (stop && stop()) return std::nullopt;
      UnitOrder order = open;
      std::rotate(order.begin() + static_cast<std::ptrdiff_t>(i), order.begin() + static_cast<std::ptrdiff_t>(i) + 1,
                  order.end());
      order.insert(order.end(), placed.begin(), placed.end());
      const std::optional<Duration> response = test.response(compiled(workload, platform, *before, order), open[i]);
      const double late =
          response ? badness(*response, due_of(before->units[open[i]])) : std::numeric_limits<double>::infinity();
      if (best && late >= least_late) continue;
      best = i;
      least_late = late;
    }
    placed.insert(placed.begin(), open[*best]);
    open.erase(open.begin() + static_cast<std::ptrdiff_t>(*best));
  }
  return placed;
}

}  // namespace redag::lab
