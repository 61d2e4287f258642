// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "tests/testing/builders.hpp"

#include <utility>

namespace redag::testing {
namespace {

Task make_task(const TestTask &given, Duration unit) {
  Task task;
  task.name = given.name;
  task.period = given.period * unit;
  task.wcet = given.wcet * unit;
  task.bcet = given.bcet > 0 ? given.bcet * unit : task.wcet;
  task.offset = given.offset * unit;
  task.deadline = given.deadline * unit;
  task.jitter = given.jitter * unit;
  task.activation = given.period == 0 ? Activation::Data : Activation::Timer;
  task.group = given.group;
  task.priority = given.priority;
  task.predecessors = given.after;
  return task;
}

}  // namespace

Dag make_dag(std::string name, const std::vector<TestTask> &tasks, std::uint32_t max_active, Duration unit) {
  Dag dag;
  dag.name = std::move(name);
  for (const TestTask &task : tasks) dag.tasks.push_back(make_task(task, unit));
  dag.max_active = max_active;
  inherit_periods(dag);
  return dag;
}

Dag tick_dag(std::string name, const std::vector<TestTask> &tasks, std::uint32_t max_active) {
  return make_dag(std::move(name), tasks, max_active, 1);
}

Task tick_task(const TestTask &task) { return make_task(task, 1); }

Workload make_workload(std::vector<Dag> dags, std::uint32_t workers, PreemptionMode preemption, PolicyKind policy) {
  return Workload{.name = "test", .platform = Platform{workers, preemption}, .policy = policy, .dags = std::move(dags)};
}

Workload independent(const std::vector<Load> &loads, std::uint32_t workers, PolicyKind policy) {
  Workload workload = make_workload({}, workers, PreemptionMode::Auto, policy);
  for (const Load &load : loads) {
    const int number = static_cast<int>(workload.dags.size());
    std::string name(1, static_cast<char>('a' + number % 26));
    if (number >= 26) name += std::to_string(number / 26);
    TestTask task = {.name = "t", .period = load.period, .wcet = load.wcet, .deadline = load.deadline};
    if (policy == PolicyKind::Fixed) task.priority = -number;
    workload.dags.push_back(tick_dag(std::move(name), {task}));
  }
  return workload;
}

Workload ladder(std::size_t tasks) {
  std::vector<TestTask> rungs;
  for (int t = 0; t < static_cast<int>(tasks); ++t) {
    rungs.push_back({.name = "t" + std::to_string(t), .period = 1000, .wcet = 1000, .priority = t});
  }
  return make_workload({make_dag("ladder", rungs)}, 1, PreemptionMode::Auto, PolicyKind::Fixed);
}

}  // namespace redag::testing
