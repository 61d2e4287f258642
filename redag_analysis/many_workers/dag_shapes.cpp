// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/many_workers/dag_shapes.hpp"

#include <algorithm>
#include <map>
#include <span>

#include "redag_analysis/core/arithmetic.hpp"
#include "redag_analysis/core/effort.hpp"
#include "redag_analysis/core/rate_edges.hpp"
#include "redag_analysis/many_workers/dag_isolated.hpp"
#include "redag_analysis/many_workers/fixed_point.hpp"

namespace redag::analysis {
namespace global {

Shape::Shape(const TaskSet &task_set, const Unit &unit, std::uint32_t workers) {
  // Each task runs from `start` to `end`: as early as possible on an unlimited number of workers.
  std::map<std::uint32_t, Duration> end;
  std::map<Duration, Duration> steps;  // by the time before the DAG's end, going back: change in the number of
                                       // executing tasks
  for (const std::uint32_t t : unit.tasks) {
    Duration start = 0;
    for (const std::uint32_t p : task_set.tasks[t].predecessors) {
      if (const auto found = end.find(p); found != end.end()) start = std::max(start, found->second);
    }
    end[t] = start + task_set.tasks[t].wcet;
    ++steps[unit.length - end[t]];
    --steps[unit.length - start];
  }
  Points left = {{0, 0}};
  Duration width = 0;
  for (const auto &[time, change] : steps) {
    const auto [before, work] = left.back();
    if (time > before) left.emplace_back(time, work + (time - before) * width);
    width += change;
  }
  left_ = limited(left, workers);

  // The choice of paths does not depend on execution times. More execution is thus never less work.
  std::vector<Duration> paths = disjoint_paths(task_set, unit, unit.tasks.size(), Heaviest::MostTasks);
  std::sort(paths.begin(), paths.end());
  Points done = {{0, 0}};
  for (std::size_t i = 0; i < paths.size(); ++i) {
    const auto [before, work] = done.back();
    const auto going_on = static_cast<Duration>(paths.size() - i);
    if (paths[i] > before) done.emplace_back(paths[i], work + (paths[i] - before) * going_on);
  }
  done_ = limited(done, workers);
}

Duration Shape::at(const Points &points, Duration time) {
  const auto after = std::upper_bound(points.begin(), points.end(), time,
                                      [](Duration value, const auto &point) { return value < point.first; });
  if (after == points.begin()) return 0;
  const auto &[before, work] = *(after - 1);
  if (after == points.end()) return work;
  return work + (time - before) * ((after->second - work) / (after->first - before));
}

// Limits the work to `workers` per instant: the smaller of the points and workers * time. Adds the instants beside a
// crossing.
Shape::Points Shape::limited(const Points &points, std::uint32_t workers) {
  const auto m = static_cast<Duration>(workers);
  const auto smaller = [&](Duration time) { return std::min(m * time, at(points, time)); };
  Points result = {{0, 0}};
  const auto add_point = [&](Duration time) {
    if (time > result.back().first) result.emplace_back(time, smaller(time));
  };
  for (std::size_t i = 0; i + 1 < points.size(); ++i) {
    const auto &[begin, work] = points[i];
    const auto &[end, more] = points[i + 1];
    const Duration slope = (more - work) / (end - begin);
    const Duration ahead = work - m * begin;  // relative to workers * time
    if (slope != m && (ahead < 0) != (more - m * end < 0)) {
      const Duration crossing = begin + std::max<Duration>(0, ahead / (m - slope));
      add_point(std::min(crossing, end));
      add_point(std::min(crossing + 1, end));
    }
    add_point(end);
  }
  // Past the points only the workers are a limit, until the volume is done.
  const Duration volume = points.back().second;
  add_point(volume / m);
  add_point(ceil_div(volume, m));
  return result;
}

Duration Shape::work(Duration x, Duration response, Duration period) const {
  // The first job's response ends `first` after the window begins, in [1, period]. Each later job comes a period after
  // the one before, and all but the last can do their whole volume.
  const Duration volume = left_.back().second;
  const Duration within = done(x);  // by one job
  const auto placed = [&](Duration first) {
    const Duration rest = x + response - first - period;  // of the window, when the second job comes
    const Duration later = rest > 0 ? rest / period * volume + done(rest % period) : 0;
    return std::min(left(first), within) + later;
  };
  // Between changes of a slope the sum is straight. Once the first job can have done all its work, a later place is
  // worse. Nor is its first instant alone ever better than all other places (docs/analysis.md, "Shapes of DAGs").
  const Duration last = std::clamp<Duration>(left_.back().first, 1, period);
  Duration most = placed(last);
  for (const auto &[time, work] : left_) {
    if (time > 0 && time < last) most = std::max(most, placed(time));
  }
  for (const auto &[time, work] : done_) {
    const Duration after = x + response - time;
    const Duration first = after > 0 ? (after - 1) % period + 1 : period;
    if (first < last) most = std::max(most, placed(first));
  }
  return most;
}

}  // namespace global

namespace {

using global::GlobalUnit;
using global::SharedTerms;

Duration least_window(const GlobalUnit &unit, std::uint32_t workers) {
  return unit.length + (unit.volume - unit.length) / static_cast<Duration>(workers);
}

// Sets `response` of units[k], given those of units[0 .. k), and `work` of these. Returns false above its limit, or
// after too many steps. `shapes` is by position in TaskSet::units. Below `start` there is no fixed point.
bool respond(std::span<GlobalUnit> units, std::span<const global::Shape> shapes, std::size_t k, std::uint32_t workers,
             Duration start) {
  GlobalUnit &own = units[k];
  if (global::is_hopeless(own, workers)) return false;
  const auto m = static_cast<Duration>(workers);
  Duration window = std::max(start, least_window(own, workers));
  const bool found = global::least_fixed_point(own.limit - own.jitter, window, [&](Duration x) {
    Duration sum = own.volume - own.length;
    for (std::size_t i = 0; i < k; ++i) {
      GlobalUnit &other = units[i];
      Effort::spend(other.tasks + 1);
      other.work = shapes[other.unit].work(x, other.response, other.period);
      sum += other.work;
    }
    return own.length + sum / m;
  });
  own.response = window + own.jitter;
  return found;
}

ResponseBound explain(const TaskSet &task_set, std::span<const GlobalUnit> units, std::size_t k,
                      std::uint32_t workers) {
  const GlobalUnit &own = units[k];
  ResponseBound bound;
  bound.response = own.response;
  SharedTerms terms(task_set, own);
  terms.add_path();
  terms.add_share(Term::Kind::Own, own, own.volume - own.length, workers);
  for (std::size_t i = 0; i < k; ++i) terms.add_share(Term::Kind::Interference, units[i], units[i].work, workers);
  terms.add_jitter();
  bound.terms = terms.take();
  return bound;
}

Outcome apply_shapes(const TaskSet &task_set) {
  // Without edges no DAG has a shape; dag_bounded() is then never above this bound, and quicker.
  if (!task_set.has_edges()) return NotApplicable{"no task has predecessors: see the bounds for independent tasks"};
  global::Units view = global::units_of(task_set, {.equals = true});
  if (view.reason) return NotApplicable{*view.reason};
  std::vector<global::Shape> shapes;
  shapes.reserve(task_set.units.size());
  for (const Unit &unit : task_set.units) shapes.emplace_back(task_set, unit, view.workers);
  return global::from_most_urgent(
      task_set, view.units,
      [&view](GlobalUnit &unit) { unit.response = least_window(unit, view.workers) + unit.jitter; },
      [&](std::size_t k, bool alone) {
        const Duration start = alone ? 0 : view.units[k].response - view.units[k].jitter;
        return respond(view.units, shapes, k, view.workers, start);
      },
      [&](std::size_t k) { return explain(task_set, view.units, k, view.workers); }, global::narrows_to_part(task_set));
}

}  // namespace

Method dag_shapes() {
  return Method{
      .name = "dag_shapes",
      .subject = Subject::Dag,
      .cite =
          "docs/analysis.md, \"Shapes of DAGs\"; after J. Fonseca, G. Nelissen, V. Nelis, Improved response time "
          "analysis of sporadic DAG tasks for global FP scheduling, RTNS 2017; Schedulability analysis of DAG tasks "
          "with arbitrary deadlines under global fixed-priority scheduling, Real-Time Systems 55, 2019",
      .assumptions =
          "m workers, full preemption, static priorities that keep DAGs together, some edges, R <= T; release jitter, "
          "shared levels; no max_active, no shared groups",
      .complexity = "pseudo-polynomial; O(tasks log tasks) per step",
      .apply = [](const TaskSet &task_set) { return across_rates(task_set, apply_shapes); },
  };
}

}  // namespace redag::analysis
