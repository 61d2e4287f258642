// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/search/scaling.hpp"

#include <algorithm>

#include "redag/base/check.hpp"
#include "redag/model/waits.hpp"
#include "redag_analysis/core/arithmetic.hpp"

namespace redag::lab {
namespace {

Duration scaled_up(Duration value, std::int64_t numerator, std::int64_t denominator) {
  return analysis::saturate((Int128{value} * numerator + denominator - 1) / denominator);
}

Duration scaled_down(Duration value, std::int64_t numerator, std::int64_t denominator) {
  return analysis::saturate(Int128{value} * numerator / denominator);
}

// Scales the execution times by `numerator` / `denominator`. The wcet becomes exactly `wcet`, which also caps the
// others, but leaves 1 ns for each stretch between waits. The waits keep their lengths.
void scale_execution(Task &task, Duration wcet, std::int64_t numerator, std::int64_t denominator) {
  wcet = std::max(wcet, shortest_demand(task));
  std::vector<Duration> points;
  for (std::size_t w = 0; w < task.waits.size(); ++w) points.push_back(wait_point(task, w, wcet));
  for (std::size_t w = 0; w < task.waits.size(); ++w) task.waits[w].after = points[w];
  task.wcet = wcet;
  task.bcet = std::min(wcet, scaled_down(task.bcet, numerator, denominator));
  if (task.region > 0) task.region = scaled_up(task.region, numerator, denominator);
  const Duration least = std::max<Duration>(1, task.bcet);
  const auto within = [&](Duration value) {
    return std::clamp(scaled_up(value, numerator, denominator), least, std::max(least, wcet));
  };
  task.execution.stddev = scaled_up(task.execution.stddev, numerator, denominator);
  if (task.execution.kind == ExecutionTime::Kind::Normal) task.execution.mean = within(task.execution.mean);
  for (Duration &sample : task.execution.samples) sample = within(sample);
}

void set_period(Task &task, Duration period) {
  if (task.deadline == task.period) task.deadline = period;
  task.period = period;
}

// Data tasks have the largest period of their predecessors.
void inherit_changed_periods(Dag &dag) {
  const std::vector<std::uint32_t> ranks = topological_ranks(dag);
  std::vector<std::uint32_t> order(ranks.size());
  for (std::uint32_t t = 0; t < ranks.size(); ++t) order[ranks[t]] = t;
  for (const std::uint32_t t : order) {
    if (dag.tasks[t].activation != Activation::Data) continue;
    Duration largest = 0;
    for (const std::uint32_t p : dag.tasks[t].predecessors) largest = std::max(largest, dag.tasks[p].period);
    set_period(dag.tasks[t], largest);
  }
}

// Returns the tasks by TaskId.
std::vector<Task *> tasks_of(Workload &workload) {
  std::vector<Task *> tasks;
  for (Dag &dag : workload.dags) {
    for (Task &task : dag.tasks) tasks.push_back(&task);
  }
  return tasks;
}

}  // namespace

std::int64_t nominal_position(const Workload &workload, const Knob &knob) {
  if (knob.kind == Knob::Kind::AllWcets || knob.kind == Knob::Kind::Rates) return kFactorUnit;
  REDAG_CHECK(!knob.tasks.empty(), "a knob for single values names its task");
  const Task &task = *flatten(workload).at(knob.tasks.front()).task;
  return knob.kind == Knob::Kind::Wcet ? task.wcet : -task.period;
}

Workload turned(const Workload &workload, const Knob &knob, std::int64_t position) {
  REDAG_CHECK(knob.kind == Knob::Kind::Period ? position < 0 : position > 0, "a knob does not turn that far");
  Workload result = workload;
  const std::vector<Task *> tasks = tasks_of(result);
  for (const std::uint32_t t : knob.tasks) {
    Task &task = *tasks.at(t);
    switch (knob.kind) {
      case Knob::Kind::Wcet: scale_execution(task, position, position, task.wcet); break;
      case Knob::Kind::AllWcets:
        scale_execution(task, scaled_up(task.wcet, position, kFactorUnit), position, kFactorUnit);
        break;
      case Knob::Kind::Period: set_period(task, -position); break;
      case Knob::Kind::Rates: set_period(task, scaled_down(task.period, kFactorUnit, position)); break;
    }
  }
  if (knob.kind == Knob::Kind::Period || knob.kind == Knob::Kind::Rates) {
    for (Dag &dag : result.dags) inherit_changed_periods(dag);
  }
  return result;
}

double load_factor(const Workload &workload, const Knob &knob, std::int64_t position) {
  const auto now = static_cast<double>(position);
  const auto before = static_cast<double>(nominal_position(workload, knob));
  return knob.kind == Knob::Kind::Period ? before / now : now / before;
}

}  // namespace redag::lab
