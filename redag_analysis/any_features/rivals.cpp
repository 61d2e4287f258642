// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/any_features/rivals.hpp"

#include <algorithm>
#include <functional>

#include "redag/sched/policy.hpp"
#include "redag_analysis/core/arithmetic.hpp"
#include "redag_analysis/core/effort.hpp"

namespace redag::analysis::any_features {
namespace {

// The least urgent place that counts for the task: its own, or the last one of what can keep it from starting.
std::uint32_t last_place(const TaskSet &task_set, std::uint32_t t, bool closed) {
  std::uint32_t last = place_of(task_set, t);
  const auto include = [&](const std::vector<std::uint32_t> &tasks) {
    const bool is_asked = std::any_of(tasks.begin(), tasks.end(), [&](std::uint32_t o) {
      return o == t || (closed && place_of(task_set, o) <= last);
    });
    const std::uint32_t before = last;
    for (const std::uint32_t o : tasks) last = std::max(last, is_asked ? place_of(task_set, o) : 0);
    return last != before;
  };
  for (bool changed = true; changed;) {
    changed = false;
    for (const CompiledDag &dag : task_set.dags) changed = (dag.max_active > 0 && include(dag.tasks)) || changed;
    // The holder has the urgency of those that wait, but one that lies under others stays there.
    if (task_set.mode != sched::Preemption::Cooperative) continue;
    for (const std::vector<std::uint32_t> &group : task_set.groups) changed = include(group) || changed;
  }
  return last;
}

// The longest stretches that other jobs can have begun, one on each worker.
Duration blocking_by(const TaskSet &task_set, const Rivals &rivals) {
  std::vector<Duration> stretches;
  for (std::uint32_t other = 0; other < task_set.tasks.size(); ++other) {
    const CompiledTask &task = task_set.tasks[other];
    // A demoted job keeps its worker, too.
    if (rivals.first[other] && !(task.can_sink && !rivals.all)) continue;
    const Duration one = std::min(task.region, task.wcet - task.waits) - 1;
    for (std::uint32_t i = 0; i < task.at_once && one > 0; ++i) stretches.push_back(one);
  }
  std::sort(stretches.begin(), stretches.end(), std::greater<>());
  stretches.resize(std::min<std::size_t>(stretches.size(), task_set.platform.workers));
  Duration sum = 0;
  for (const Duration one : stretches) sum = add(sum, one);
  return sum;
}

// All tasks down to this place. Groups lift their holders above it.
void close(const TaskSet &task_set, std::uint32_t last, Rivals &rivals) {
  const std::size_t count = task_set.tasks.size();
  rivals.first.assign(count, rivals.all);
  Effort::spend(count);
  for (std::uint32_t o = 0; o < count && !rivals.all; ++o) rivals.first[o] = place_of(task_set, o) <= last;
  for (const std::vector<std::uint32_t> &group : task_set.groups) {
    const bool lifts = std::any_of(group.begin(), group.end(), [&](std::uint32_t o) { return rivals.first[o]; });
    for (const std::uint32_t o : group) rivals.lifted[o] = lifts && !rivals.first[o];
  }
  if (task_set.mode == sched::Preemption::Full) return;
  // On top of a demoted job that lies on another one, everything can run.
  for (std::uint32_t o = 0; o < count && task_set.mode == sched::Preemption::Cooperative && !rivals.all; ++o) {
    if (!task_set.tasks[o].can_sink || !(rivals.first[o] || rivals.lifted[o])) continue;
    rivals.all = true;
    return close(task_set, last, rivals);
  }
  rivals.blocking = blocking_by(task_set, rivals);
}

}  // namespace

std::uint32_t place_of(const TaskSet &task_set, std::uint32_t t) {
  return task_set.mode == sched::Preemption::None ? task_set.tasks[t].tier : task_set.tasks[t].level;
}

Rivals rivals_of(const TaskSet &task_set, bool few_threads, std::uint32_t t, bool all, bool closed) {
  const CompiledTask &task = task_set.tasks[t];
  Rivals rivals;
  for (std::vector<bool> *marks : {&rivals.held_for, &rivals.fills, &rivals.lifted}) {
    marks->assign(task_set.tasks.size(), false);
  }
  rivals.cap = task_set.dags[task.dag.value].max_active;
  rivals.divisor = task_set.platform.workers;
  const bool is_ordered = is_static(task_set.policy) && !few_threads && !task.can_sink;
  rivals.all = all || !is_ordered;
  // Whoever is less urgent takes a group only if the task does not wait for it.
  rivals.finds_one = is_ordered && rivals.cap == 0;
  const std::uint32_t last = last_place(task_set, t, closed);
  for (std::uint32_t o = 0; o < task_set.tasks.size(); ++o) {
    const CompiledTask &other = task_set.tasks[o];
    rivals.held_for[o] = o != t && other.group != kNoGroup && other.group == task.group;
    rivals.fills[o] = o != t && rivals.cap > 0 && other.dag == task.dag;
    // What fills a DAG can be demoted below everything else.
    const bool is_capped = task_set.dags[other.dag.value].max_active > 0;
    const bool fills_some = rivals.fills[o] || (closed && is_capped && place_of(task_set, o) <= last);
    rivals.all = rivals.all || (fills_some && other.can_sink);
  }
  close(task_set, last, rivals);
  return rivals;
}

}  // namespace redag::analysis::any_features
