// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/search/scaling.hpp"

#include <algorithm>

#include "redag/base/check.hpp"
#include "redag/derived/waits.hpp"
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
  if (knob.kind == Knob::Kind::AllWcets) return kFactorUnit;
  REDAG_CHECK(!knob.tasks.empty(), "a knob for single values names its task");
  return flatten(workload).at(knob.tasks.front()).task->wcet;
}

Workload turned(const Workload &workload, const Knob &knob, std::int64_t position) {
  REDAG_CHECK(position > 0, "a knob does not turn that far");
  Workload result = workload;
  const std::vector<Task *> tasks = tasks_of(result);
  for (const std::uint32_t t : knob.tasks) {
    Task &task = *tasks.at(t);
    const bool is_factor = knob.kind == Knob::Kind::AllWcets;
    const std::int64_t unit = is_factor ? kFactorUnit : task.wcet;
    scale_execution(task, is_factor ? scaled_up(task.wcet, position, unit) : position, position, unit);
  }
  return result;
}

double load_factor(const Workload &workload, const Knob &knob, std::int64_t position) {
  return static_cast<double>(position) / static_cast<double>(nominal_position(workload, knob));
}

}  // namespace redag::lab
