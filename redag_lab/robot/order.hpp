// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// One order for all tasks of a robot, and for threads that have the rate of tasks: sched::assign_priorities() over all
// of them. Tasks that the policy ranks equal share a level, and so do neighbours if there are too few levels. An order
// by the bounds has been found before (assigned_order.hpp). Pure.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "redag_lab/robot/robot.hpp"

namespace redag::robot {

struct Order {
  std::vector<std::vector<std::uint32_t>> of_task;       // by process and TaskId; 0 is the most urgent level
  std::vector<std::optional<std::uint32_t>> of_threads;  // by entry; nothing: not among the tasks
  std::uint32_t levels = 0;                              // that are used
  std::uint32_t ranks = 0;  // that the policy tells apart; more than `levels`: some share one

  [[nodiscard]] bool is_merged() const { return ranks > levels; }
};

/// `levels`: the most that there are; 0: no limit. An order by the bounds that is not known yet is that of rates.
[[nodiscard]] Order order_of(const Robot &robot, std::uint32_t levels);

/// The levels that the executor of a process tells apart, by TaskId, 0 first; nothing: threads execute the task.
[[nodiscard]] std::vector<std::optional<std::uint32_t>> own_levels(const Robot &robot, std::size_t process);

}  // namespace redag::robot
