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
  for (const Process &process : robot.processes) {
    if (!process.workload) continue;
    for (const TaskRef &ref : flatten(*process.workload)) {
      const Task &task = *ref.task;
      ranked.push_back(sched::RankedTask{.period = task.period,
                                         .deadline = task.deadline,
                                         .priority = task.priority.value_or(0),
                                         .dag = first_dag + ref.dag.value,
                                         .task = TaskId(ranked.size())});
    }
    first_dag += static_cast<std::uint32_t>(process.workload->dags.size());
  }
  for (const Threads &threads : robot.threads) {
    if (!threads.level || threads.level->kind != Level::Kind::Rate) continue;
    ranked.push_back(sched::RankedTask{.period = threads.level->rate,
                                       .deadline = threads.level->rate,
                                       .dag = first_dag++,
                                       .task = TaskId(ranked.size())});
  }
  return ranked;
}

}  // namespace

Order order_of(const Robot &robot, std::uint32_t levels) {
  const std::vector<sched::RankedTask> ranked = ranked_tasks(robot);
  const auto priorities = sched::assign_priorities(ranked, robot.policy, Ties::Share, levels);
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

}  // namespace redag::robot
