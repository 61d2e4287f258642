// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// What differs between a plan and the threads and interrupts of the machine. Pure.
#pragma once

#include <string>
#include <vector>

#include "redag_lab/robot/plan.hpp"
#include "redag_lab/robot/robot.hpp"
#include "redag_lab/robot/system.hpp"

namespace redag::robot {

struct ThreadChange {
  ThreadId thread;
  std::string name;     // of the thread
  std::string program;  // of its process
  std::string entry;    // of the robot: "threads scan", "process drive"
  ThreadState before;
  ThreadState after;
};

struct InterruptChange {
  int number = 0;
  std::string name;
  std::vector<int> before;
  std::vector<int> after;
};

struct Changes {
  std::vector<ThreadChange> threads;
  std::vector<InterruptChange> interrupts;
  std::size_t matched = 0;           // threads that the robot names, changed or not
  std::vector<std::string> remarks;  // what a user should know: "no process matches 'drive'"
  // By process of the robot: the numbers of those that run.
  std::vector<std::vector<std::int64_t>> running;

  [[nodiscard]] bool is_empty() const { return threads.empty() && interrupts.empty(); }
};

[[nodiscard]] Changes changes_of(const Robot &robot, const Plan &plan, const Snapshot &snapshot);

/// Says which running executors did not begin with the priorities of the plan (REDAG_LEVELS).
[[nodiscard]] std::vector<std::string> remarks_on_executors(const Robot &robot, const Plan &plan,
                                                            const Changes &changes, const System &system);

}  // namespace redag::robot
