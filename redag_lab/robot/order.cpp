// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/robot/order.hpp"

#include <algorithm>

#include "redag/sched/policy.hpp"

namespace redag::robot {
namespace {

std::vector<sched::RankedTask> ranked_tasks(const Robot &robot) {
  std::vector<sched::RankedTask> ranked;
  std::uint32_t first_dag = 0;
  for (std::size_t p = 0; p < robot.processes.size(); ++p) {
    const Process &process = robot.processes[p];
    if (!process.workload) continue;
    for (const TaskRef &ref : flatten(*process.workload)) {
      const Task &task = *ref.task;
      const int given = task.priority.value_or(0);
      ranked.push_back(sched::RankedTask{
          .period = task.period,
          .deadline = task.deadline,
          .priority = robot.assigned ? -static_cast<int>(robot.assigned->of_task[p][ref.id.value]) : given,
          .dag = first_dag + ref.dag.value,
          .task = TaskId(ranked.size())});
    }
    first_dag += static_cast<std::uint32_t>(process.workload->dags.size());
  }
  for (std::size_t t = 0; t < robot.threads.size(); ++t) {
    const Threads &threads = robot.threads[t];
    if (!threads.level || threads.level->kind != Level::Kind::Rate) continue;
    ranked.push_back(
        sched::RankedTask{.period = threads.level->rate,
                          .deadline = threads.level->rate,
                          .priority = robot.assigned ? -static_cast<int>(robot.assigned->of_threads[t].value()) : 0,
                          .dag = first_dag++,
                          .task = TaskId(ranked.size())});
  }
  return ranked;
}

}  // namespace

Order order_of(const Robot &robot, std::uint32_t levels) {
  const std::vector<sched::RankedTask> ranked = ranked_tasks(robot);
  const PolicyKind policy = robot.assigned ? PolicyKind::Fixed : robot.policy;
  const auto priorities = sched::assign_priorities(ranked, policy, Ties::Share, levels);
  Order order;
  for (const sched::Priority &priority : priorities) {
    order.ranks = std::max(order.ranks, priority.tier + 1);
    order.levels = std::max(order.levels, priority.level + 1);
  }
  auto next = priorities.begin();
  for (const Process &process : robot.processes) {
    std::vector<std::uint32_t> &of_process = order.of_task.emplace_back();
    const std::size_t count = process.workload ? process.workload->task_count() : 0;
    for (std::size_t t = 0; t < count; ++t) of_process.push_back((next++)->level);
  }
  for (const Threads &threads : robot.threads) {
    std::optional<std::uint32_t> level;
    if (threads.level && threads.level->kind == Level::Kind::Rate) level = (next++)->level;
    if (threads.level && threads.level->kind == Level::Kind::Task) {
      level = order.of_task[threads.level->task.process][threads.level->task.task.value];
    }
    order.of_threads.push_back(level);
  }
  return order;
}

std::vector<std::optional<std::uint32_t>> own_levels(const Robot &robot, std::size_t process) {
  const Workload &workload = robot.processes[process].workload.value();
  std::vector<std::optional<std::uint32_t>> levels(workload.task_count());
  std::vector<sched::RankedTask> own;
  std::vector<TaskId> ids;
  for (const TaskRef &ref : flatten(workload)) {
    if (is_of_threads(robot, process, ref.id)) continue;
    own.push_back(sched::RankedTask{.period = ref.task->period,
                                    .deadline = ref.task->deadline,
                                    .priority = ref.task->priority.value_or(0),
                                    .task = TaskId(own.size())});
    ids.push_back(ref.id);
  }
  const auto ranked = sched::assign_priorities(own, own_policy(robot, process), Ties::Share);
  for (std::size_t t = 0; t < ids.size(); ++t) levels[ids[t].value] = ranked[t].tier;
  return levels;
}

}  // namespace redag::robot
