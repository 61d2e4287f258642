// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/trace/trace.hpp"

namespace redag::trace {

bool has_valid_times(const JobEvent &event) {
  // A deadline lies after the end of the longest run by at most the longest deadline.
  constexpr Time kMaxValue = kMaxTraceTime + kMaxDuration;
  return event.time >= -kMaxTraceTime && event.time <= kMaxTraceTime && event.value >= -kMaxValue &&
         event.value <= kMaxValue;
}

const char *to_string(Driver driver) {
  switch (driver) {
    case Driver::Simulator: return "simulator";
    case Driver::Threads: return "threads";
    case Driver::Ros: return "ros";
    case Driver::RosNodes: return "ros_nodes";
  }
  return "?";
}

const char *preemption_name(sched::Preemption mode) {
  switch (mode) {
    case sched::Preemption::None: return "none";
    case sched::Preemption::Cooperative: return "cooperative";
    case sched::Preemption::Full: return "os";
  }
  return "?";
}

std::string task_name(const Workload &workload, TaskId task) {
  std::size_t index = task.value;
  for (const Dag &dag : workload.dags) {
    if (index < dag.tasks.size()) return dag.name + "." + dag.tasks[index].name;
    index -= dag.tasks.size();
  }
  return task.valid() ? "task " + std::to_string(task.value) : "no task";
}

}  // namespace redag::trace
