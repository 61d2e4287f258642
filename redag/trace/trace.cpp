// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/trace/trace.hpp"

#include <sched.h>

#include <fstream>

namespace redag::trace {
namespace {

// The first "model name" of /proc/cpuinfo; empty if there is none (most ARM kernels).
std::string processor_name() {
  std::ifstream file("/proc/cpuinfo");
  std::string line;
  while (std::getline(file, line)) {
    if (line.rfind("model name", 0) != 0) continue;
    const std::size_t text = line.find_first_not_of(": \t", line.find(':'));
    return text == std::string::npos ? std::string() : line.substr(text);
  }
  return {};
}

}  // namespace

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

Machine this_machine() {
  Machine machine;
  cpu_set_t set;
  CPU_ZERO(&set);
  if (sched_getaffinity(0, sizeof set, &set) == 0) machine.cpus = static_cast<std::uint32_t>(CPU_COUNT(&set));
  machine.kernel = kernel_name();
  machine.model = processor_name();
  return machine;
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
