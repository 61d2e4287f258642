// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/any_features/demand.hpp"

#include <algorithm>
#include <optional>

#include "redag_analysis/core/arithmetic.hpp"

namespace redag::analysis::any_features {
namespace {

// A data task has no more releases than a predecessor has ends, and one for an end that came before.
void count_releases(const TaskSet &task_set, std::uint32_t t, std::vector<JobCount> &counts, std::vector<bool> &known) {
  if (known[t]) return;
  known[t] = true;
  const CompiledTask &task = task_set.tasks[t];
  counts[t] = JobCount{task.period, task.jitter, 1};
  if (!task.data) return;
  std::optional<JobCount> least;
  for (const std::uint32_t p : task.predecessors) {
    count_releases(task_set, p, counts, known);
    JobCount ends = counts[p];
    ends.more = add(ends.more, unfinished(task_set.tasks[p]) + (task.predecessors.size() > 1 ? 1 : 0));
    least = least ? rarer(ends, *least) : ends;
  }
  if (least) counts[t] = *least;
}

// The most jobs that are started and unfinished at once.
std::uint64_t most_started(const TaskSet &task_set) {
  std::uint64_t sum = 0;
  for (const CompiledDag &dag : task_set.dags) {
    std::uint64_t most = 0;
    std::vector<std::uint32_t> groups;
    for (const std::uint32_t t : dag.tasks) {
      const std::uint32_t group = task_set.tasks[t].group;
      const bool is_counted = group != kNoGroup && std::find(groups.begin(), groups.end(), group) != groups.end();
      if (group != kNoGroup) groups.push_back(group);
      most += is_counted ? 0 : task_set.tasks[t].at_once;
    }
    sum += dag.max_active > 0 ? std::min<std::uint64_t>(most, dag.max_active) : most;
  }
  return sum;
}

}  // namespace

JobCount rarer(const JobCount &a, const JobCount &b) {
  if (a.period != b.period) return a.period > b.period ? a : b;
  return a.in(a.period) < b.in(b.period) ? a : b;
}

Duration unfinished(const CompiledTask &task) {
  const Duration queued = std::max<Duration>(1, task.limit / task.period);
  return task.at_once + queued + (waits_for_data(task) ? 1 : 0);
}

Duration away(const CompiledTask &task) {
  Duration sum = task.elsewhere;
  for (const DeviceUse &use : task.devices) sum = add(sum, use.service);
  return sum;
}

Demand::Demand(const TaskSet &all)
    : task_set(all), released(all.tasks.size()), since(all.tasks.size()), until(all.tasks.size()) {
  std::vector<bool> known(all.tasks.size(), false);
  for (std::uint32_t t = 0; t < all.tasks.size(); ++t) count_releases(all, t, released, known);
  const std::uint32_t threads = all.platform.max_started;
  few_threads = all.mode == sched::Preemption::Full && threads > 0 && threads < most_started(all);
  for (const CompiledTask &one : all.tasks) {
    stop = std::max(stop, multiply(one.period, 4096));
    has_waits = has_waits || one.wake_ups > 0;
  }
}

// The last one is released before it ends, and the first one ends after the window begins.
Duration Demand::active(std::uint32_t t, Duration window) const {
  const Duration all = add(released[t].in(window - 1), unfinished(task(t)));
  if (!since[t] || (waits_for_data(task(t)) && !until[t])) return all;
  const Duration in_flight = add(*since[t], until[t].value_or(0));
  return std::min(all, released[t].in(std::max<Duration>(0, add(window, in_flight) - 2)));
}

Duration lifted_work(const TaskSet &task_set, const std::vector<std::uint32_t> &group, const Rivals &rivals,
                     const std::function<Duration(std::uint32_t)> &jobs,
                     const std::function<Duration(std::uint32_t)> &cost) {
  Duration all = 0;
  Duration longest = 0;
  Duration waiters = 0;
  bool is_capped_member = false;
  for (const std::uint32_t o : group) {
    if (rivals.first[o]) {
      waiters = add(waiters, jobs(o));
      is_capped_member = is_capped_member || task_set.dags[task_set.tasks[o].dag.value].max_active > 0;
    } else if (rivals.lifted[o]) {
      all = add(all, multiply(jobs(o), cost(o)));
      longest = std::max(longest, cost(o));
    }
  }
  return is_capped_member ? all : std::min(all, multiply(waiters, longest));
}

}  // namespace redag::analysis::any_features
