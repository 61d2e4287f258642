// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/trace/this_machine.hpp"

#include <sched.h>

#include <cstdint>
#include <fstream>
#include <string>

#include "redag/loader/provenance.hpp"

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

Machine this_machine() {
  Machine machine;
  cpu_set_t set;
  CPU_ZERO(&set);
  if (sched_getaffinity(0, sizeof set, &set) == 0) machine.cpus = static_cast<std::uint32_t>(CPU_COUNT(&set));
  machine.kernel = kernel_name();
  machine.model = processor_name();
  return machine;
}

void add_provenance(RunInfo &info) {
  info.machine = this_machine();
  info.provenance = current_provenance();
}

}  // namespace redag::trace
