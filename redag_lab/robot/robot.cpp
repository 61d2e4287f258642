// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/robot/robot.hpp"

#include <algorithm>
#include <utility>

namespace redag::robot {

const char *policy_name(const Robot &robot) { return robot.by_bounds ? kAudsley : to_string(robot.policy); }

PolicyKind own_policy(const Robot &robot, std::size_t process) {
  const std::optional<Workload> &workload = robot.processes[process].workload;
  return robot.by_bounds && workload ? workload->policy : robot.policy;
}

std::size_t host_of(const Robot &robot, std::size_t process) {
  return robot.cpu_sets[robot.processes[process].cpu_set].host;
}

Robot part_of(const Robot &robot, std::size_t host) {
  constexpr std::size_t kElsewhere = static_cast<std::size_t>(-1);
  Robot part;
  part.name = robot.name + "/" + robot.hosts[host];
  part.policy = robot.policy;
  part.by_bounds = robot.by_bounds;
  if (robot.assigned) part.assigned = AssignedOrder{.tests = robot.assigned->tests, .found = robot.assigned->found};
  std::vector<std::size_t> sets(robot.cpu_sets.size(), kElsewhere);  // positions in the part
  for (std::size_t s = 0; s < sets.size(); ++s) {
    if (robot.cpu_sets[s].host != host) continue;
    sets[s] = part.cpu_sets.size();
    part.cpu_sets.push_back(robot.cpu_sets[s]);
    part.cpu_sets.back().host = 0;
  }
  std::vector<std::size_t> processes(robot.processes.size(), kElsewhere);
  for (std::size_t p = 0; p < processes.size(); ++p) {
    if (host_of(robot, p) != host) continue;
    processes[p] = part.processes.size();
    part.processes.push_back(robot.processes[p]);
    part.processes.back().cpu_set = sets[robot.processes[p].cpu_set];
    if (part.assigned) part.assigned->of_task.push_back(robot.assigned->of_task[p]);
  }
  for (Link link : robot.links) {
    link.from.process = processes[link.from.process];
    link.to.process = processes[link.to.process];
    if (link.from.process != kElsewhere && link.to.process != kElsewhere) part.links.push_back(std::move(link));
  }
  for (std::size_t t = 0; t < robot.threads.size(); ++t) {
    Threads threads = robot.threads[t];
    if (std::exchange(threads.host, 0) != host) continue;
    if (part.assigned) part.assigned->of_threads.push_back(robot.assigned->of_threads[t]);
    if (threads.process) threads.process = processes[*threads.process];
    if (threads.level && threads.level->kind == Level::Kind::Task) {
      threads.level->task.process = processes[threads.level->task.process];
    }
    part.threads.push_back(std::move(threads));
  }
  for (Interrupts interrupts : robot.interrupts) {
    if (std::exchange(interrupts.host, 0) == host) part.interrupts.push_back(std::move(interrupts));
  }
  return part;
}

bool is_of_threads(const Robot &robot, std::size_t process, TaskId task) {
  return std::any_of(robot.threads.begin(), robot.threads.end(), [&](const Threads &threads) {
    return threads.level && threads.level->kind == Level::Kind::Task && threads.level->task.process == process &&
           threads.level->task.task == task;
  });
}

bool has_executor(const Robot &robot, std::size_t process) {
  const std::optional<Workload> &workload = robot.processes[process].workload;
  if (!workload) return false;
  for (std::size_t t = 0; t < workload->task_count(); ++t) {
    if (!is_of_threads(robot, process, TaskId(t))) return true;
  }
  return false;
}

}  // namespace redag::robot
