// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/core/waiting.hpp"

#include <algorithm>

#include "redag/model/waits.hpp"
#include "redag/sched/policy.hpp"
#include "redag_analysis/core/arithmetic.hpp"

namespace redag::analysis {
namespace {

// The longest service of a job of the task at the device; 0: it never asks.
Duration longest_service(const Task &task, DeviceId device) {
  Duration longest = 0;
  for (const Wait &wait : task.waits) {
    if (wait.device == device) longest = std::max(longest, wait.longest);
  }
  return longest;
}

}  // namespace

std::vector<Duration> waiting_times(const Workload &workload) {
  std::vector<Duration> times;
  if (!has_waits(workload)) return times;
  const std::vector<sched::Priority> priorities =
      sched::assign_priorities(workload.dags, workload.policy, workload.ties, 0);
  const std::vector<TaskRef> tasks = flatten(workload);
  for (const TaskRef &own : tasks) {
    Duration time = 0;
    for (const Wait &wait : own.task->waits) {
      time = add(time, wait.longest);
      if (!wait.device.valid()) continue;
      Duration one = 0;
      Duration all = 0;
      for (const TaskRef &other : tasks) {
        if (priorities[other.id.value].tier <= priorities[own.id.value].tier) continue;
        const Duration service = longest_service(*other.task, wait.device);
        one = std::max(one, service);
        all = add(all, service);
      }
      const bool is_fifo = workload.platform.devices[wait.device.value].queue == Device::Queue::Fifo;
      time = add(time, is_fifo ? all : one);
    }
    times.push_back(time);
  }
  return times;
}

std::string why_waits_are_not_covered(const TaskSet &task_set) {
  const AnalysisPlatform &platform = task_set.platform;
  if (!is_static(task_set.policy)) return "waits are covered under static priorities only";
  if (platform.workers > 1) return "waits are covered on one worker only";
  if (task_set.mode != sched::Preemption::Full) return "waits are covered with full preemption only";
  if (!task_set.groups.empty()) return "a job that waits holds its group, for which no bound is known";
  if (platform.levels > 0 || platform.max_started > 0)
    return "waits are covered without bounds on levels or threads only";
  if (!(platform == AnalysisPlatform{})) return "waits are covered on a platform without overheads only";
  if (task_set.has_rate_edges()) return "waits are covered without edges between rates only";
  for (const CompiledDag &dag : task_set.dags) {
    if (dag.max_active > 0 && dag.units.size() > 1)
      return "DAG '" + dag.name + "': a job that waits counts for max_active";
  }
  return {};
}

}  // namespace redag::analysis
