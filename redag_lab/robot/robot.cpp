// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/robot/robot.hpp"

#include <algorithm>

namespace redag::robot {

bool is_of_threads(const Robot &robot, std::size_t process, TaskId task) {
  return std::any_of(robot.threads.begin(), robot.threads.end(), [&](const Threads &threads) {
    return threads.level.kind == Level::Kind::Task && threads.level.task.process == process &&
           threads.level.task.task == task;
  });
}

bool has_executor(const Robot &robot, std::size_t process) {
  for (std::size_t t = 0; t < robot.processes[process].workload.task_count(); ++t) {
    if (!is_of_threads(robot, process, TaskId(t))) return true;
  }
  return false;
}

}  // namespace redag::robot
