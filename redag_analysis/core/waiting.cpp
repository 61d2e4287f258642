// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/core/waiting.hpp"

#include <algorithm>

#include "redag/derived/waits.hpp"
#include "redag/sched/policy.hpp"
#include "redag_analysis/core/arithmetic.hpp"

namespace redag::analysis {
namespace {

// The waits of the task's own jobs.
WaitingTime own_waits(const Task &task, const std::vector<Device> &devices) {
  WaitingTime time;
  time.devices.resize(devices.size());
  for (const Wait &wait : task.waits) {
    if (!wait.device.valid()) {
      time.elsewhere = add(time.elsewhere, wait.longest);
      continue;
    }
    DeviceUse &use = time.devices[wait.device.value];
    // What other clusters ask before a request is as if its own service took longer.
    const Duration service = add(wait.longest, devices[wait.device.value].others);
    ++use.requests;
    use.service = add(use.service, service);
    use.longest = std::max(use.longest, service);
  }
  return time;
}

}  // namespace

Duration WaitingTime::total() const {
  Duration sum = elsewhere;
  for (const DeviceUse &use : devices) sum = add(sum, add(use.service, use.blocked));
  return sum;
}

std::vector<WaitingTime> waiting_times(const Workload &workload) {
  std::vector<WaitingTime> times;
  if (!has_waits(workload)) return times;
  const std::vector<Device> &devices = workload.platform.devices;
  for (const TaskRef &task : flatten(workload)) times.push_back(own_waits(*task.task, devices));
  const std::vector<sched::Priority> priorities =
      sched::assign_priorities(workload.dags, workload.policy, workload.ties, 0);
  for (std::size_t t = 0; t < times.size(); ++t) {
    for (std::size_t d = 0; d < devices.size(); ++d) {
      DeviceUse &own = times[t].devices[d];
      if (own.requests == 0) continue;
      Duration one = 0;
      Duration all = 0;
      for (std::size_t other = 0; other < times.size(); ++other) {
        if (priorities[other].tier <= priorities[t].tier) continue;
        const Duration service = times[other].devices[d].longest;
        one = std::max(one, service);
        all = add(all, service);
      }
      own.blocked = multiply(devices[d].queue == Device::Queue::Fifo ? all : one, own.requests);
    }
  }
  return times;
}

std::string why_waits_are_not_covered(const TaskSet &task_set) {
  if (task_set.mode == sched::Preemption::Cooperative)
    return "callbacks that wait (segments) have bounds only without cooperative preemption points";
  if (!task_set.groups.empty())
    return "callbacks that wait (segments) have bounds only without groups, which a job holds while it waits";
  for (std::size_t rank = 1; rank < task_set.by_rank.size(); ++rank) {
    const CompiledTask &upper = task_set.tasks[task_set.by_rank[rank - 1]];
    const CompiledTask &lower = task_set.tasks[task_set.by_rank[rank]];
    if (upper.level == lower.level && upper.tier != lower.tier)
      return "callbacks that wait (segments) have bounds only if each priority has a level of its own";
  }
  if (task_set.platform.max_started > 0 && task_set.platform.max_started < task_set.tasks.size())
    return "callbacks that wait (segments) have bounds only with as many threads as tasks";
  for (const CompiledDag &dag : task_set.dags) {
    if (dag.max_active > 0 && dag.units.size() > 1)
      return "DAG '" + dag.name + "': a job that waits counts for max_active";
  }
  return {};
}

}  // namespace redag::analysis
