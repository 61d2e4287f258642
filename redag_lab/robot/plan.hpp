// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The SCHED_FIFO priority of every task and thread of a robot: the levels of order_of() within a band of priorities, as
// an executor of ReDAG-RT maps its own levels (runtime::PriorityBand). Pure.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "redag/base/result.hpp"
#include "redag/runtime/setup.hpp"
#include "redag_lab/robot/order.hpp"
#include "redag_lab/robot/robot.hpp"
#include "redag_lab/robot/system.hpp"

namespace redag::robot {

/// A row of the plan.
struct PlannedLevel {
  int priority = 0;
  // Periods, or deadlines, or priorities of policy `fixed`: what the robot's policy orders by.
  std::int64_t first = 0;            // of the most urgent
  std::int64_t last = 0;             // of the least urgent; another than `first` where neighbours share the level
  std::vector<std::string> members;  // "drive.control.read", "threads scan"
};

struct Plan {
  runtime::PriorityBand band;
  Order order;
  std::vector<PlannedLevel> levels;  // most urgent first
  // By process: the priorities of the levels that its executor tells apart, most urgent first; empty: no executor.
  std::vector<std::vector<int>> of_executor;
  std::vector<std::optional<Scheduling>> of_threads;  // by entry; nothing: they keep theirs
};

/// Error: the band has too few priorities, or an entry asks for one that it cannot have.
[[nodiscard]] Result<Plan> plan_of(const Robot &robot, runtime::PriorityBand band);

/// The value of REDAG_LEVELS for the executor of a process: "80,78,77".
[[nodiscard]] std::string levels_text(const std::vector<int> &priorities);

}  // namespace redag::robot
