// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/one_worker/exact_points.hpp"

#include <algorithm>

#include "redag_analysis/core/arithmetic.hpp"
#include "redag_analysis/core/effort.hpp"
#include "redag_analysis/one_worker/one_worker.hpp"

namespace redag::analysis {
namespace {

constexpr std::size_t kMaxPoints = 1'000'000;

// Returns P_{i-1}(deadline) over `more_urgent`, most urgent first; empty if it is too large.
std::vector<Duration> points(Duration deadline, const std::vector<one_worker::Interferer> &more_urgent) {
  std::vector<Duration> found = {deadline};
  for (auto task = more_urgent.rbegin(); task != more_urgent.rend(); ++task) {
    const std::size_t count = found.size();
    Effort::spend(count);
    for (std::size_t i = 0; i < count; ++i) {
      const Duration multiple = found[i] / task->period * task->period;
      if (multiple > 0) found.push_back(multiple);
    }
    std::sort(found.begin(), found.end());
    found.erase(std::unique(found.begin(), found.end()), found.end());
    if (found.size() > kMaxPoints) return {};
  }
  return found;
}

bool fits(Duration start, Duration point, const std::vector<one_worker::Interferer> &more_urgent) {
  Effort::spend(more_urgent.size());
  Int128 demand = start;
  for (const one_worker::Interferer &other : more_urgent) {
    demand += Int128{ceil_div(point, other.period)} * other.wcet;
  }
  return demand <= point;
}

std::optional<std::string> why_not_exact(const TaskSet &task_set) {
  if (auto reason = one_worker::why_not(task_set)) return reason;
  if (task_set.mode != sched::Preemption::Full) return "requires full preemption";
  for (const Unit &unit : task_set.units) {
    const std::string &name = task_set.tasks[unit.tasks.front()].name;
    if (unit.jitter > 0) return "task '" + name + "' has release jitter";
    if (unit.deadline > unit.limit || unit.deadline > unit.period) {
      return "task '" + name + "' has a deadline above its period";
    }
  }
  return std::nullopt;
}

Outcome apply_exact_points(const TaskSet &task_set) {
  if (auto reason = why_not_exact(task_set)) return NotApplicable{*reason};
  Bound bound;
  bound.accepts = true;
  std::size_t examined = 0;
  one_worker::Views views(task_set);
  for (std::uint32_t u = 0; u < task_set.units.size(); ++u) {
    const one_worker::View view = views.of(u);
    const Unit &unit = task_set.units[u];
    const std::vector<Duration> candidates = points(unit.deadline, view.more_urgent);
    if (candidates.empty()) return NotApplicable{"gave up: there are more than a million points"};
    examined += candidates.size();
    const Duration start = add(view.blocking, unit.volume);
    const bool found = std::any_of(candidates.begin(), candidates.end(),
                                   [&](Duration point) { return fits(start, point, view.more_urgent); });
    if (found) continue;
    bound.accepts = false;
    bound.figures = "'" + task_set.tasks[unit.tasks.front()].name + "' has no point at which its demand fits";
    return bound;
  }
  bound.figures = std::to_string(examined) + " points";
  return bound;
}

}  // namespace

Method exact_points() {
  return Method{
      .name = "exact_points",
      .subject = Subject::TaskSet,
      .cite =
          "E. Bini, G. C. Buttazzo, Schedulability analysis of periodic fixed priority systems, IEEE Transactions on "
          "Computers 53(11), 2004",
      .assumptions =
          "one worker, full preemption, static priorities, D <= T, no jitter; blocking added; a DAG of one rate counts "
          "as "
          "one task with C = volume",
      .complexity = "O(n 2^n) in the worst case, far less in practice",
      .apply = apply_exact_points,
  };
}

}  // namespace redag::analysis
