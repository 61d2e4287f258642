// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Reads the threads of this process from the kernel. Tests use it to see which threads an executor leaves behind or
// wakes.
#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <map>
#include <string>

namespace redag_rclcpp {

struct ProcessTask {
  std::string name;
  std::uint64_t switches = 0;  // voluntary switches: how often the thread went to sleep
  std::chrono::nanoseconds processor_time{0};
};

/// Threads by id. Threads that end meanwhile are left out.
inline std::map<int, ProcessTask> process_tasks() {
  std::map<int, ProcessTask> tasks;
  std::error_code ignored;
  for (const auto &entry : std::filesystem::directory_iterator("/proc/self/task", ignored)) {
    ProcessTask task;
    std::ifstream comm(entry.path() / "comm");
    std::ifstream status(entry.path() / "status");
    if (!std::getline(comm, task.name)) continue;
    for (std::string key; status >> key;) {
      if (key == "voluntary_ctxt_switches:") status >> task.switches;
    }
    std::int64_t time = 0;
    if (std::ifstream(entry.path() / "schedstat") >> time) task.processor_time = std::chrono::nanoseconds(time);
    tasks[std::stoi(entry.path().filename())] = task;
  }
  return tasks;
}

}  // namespace redag_rclcpp
