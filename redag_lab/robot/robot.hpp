// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// A robot (docs/robot.md): the processes of a computer, and threads of others that can delay their jobs. Plain values.
// robot_yaml.hpp reads them, and union.hpp makes one workload of them.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "redag/base/ids.hpp"
#include "redag/base/time.hpp"
#include "redag/model/workload.hpp"

namespace redag::robot {

/// Where an entry stands in its file, for messages about it.
struct Place {
  std::string file;
  int line = 0;
  int column = 0;
};

/// Processors for processes. Sets share none.
struct CpuSet {
  std::string name;       // empty: the only one
  std::vector<int> cpus;  // ascending
};

struct Process {
  std::string name;
  std::size_t cpu_set = 0;  // position in Robot::cpu_sets
  Workload workload;
  bool states_workers = false;  // the workload says its number of workers
  Place place;
};

/// A task of a process.
struct TaskOf {
  std::size_t process = 0;  // position in Robot::processes
  TaskId task = {};         // in the process's workload
  std::string name;         // "process.dag.task"
};

/// Processor time that the kernel grants a thread, and takes away when it is used up (SCHED_DEADLINE).
struct Reservation {
  Duration budget = 0;
  Duration period = 0;
  // Of the kernel, which only looks then whether the budget is used up: at least that of its CONFIG_HZ.
  Duration tick = 0;
};

/// Where threads belong in the order.
struct Level {
  enum class Kind : std::uint8_t {
    Task,         // the level of a task, which they execute
    Rate,         // that of a task of period `rate`
    Above,        // above all tasks
    Reservation,  // SCHED_DEADLINE: before all others, but no longer than `reservation` says
  };
  Kind kind = Kind::Above;
  TaskOf task = {};  // Task
  Duration rate = 0;
  Reservation reservation = {};
};

/// Threads that execute a task, or that can delay tasks.
struct Threads {
  std::string name;
  Level level;
  std::size_t cpu_set = 0;  // Rate, Above: where they run
  std::uint32_t count = 1;  // of Rate, Above and Reservation: the most of them that there are
  Duration wcet = 0;        // Rate, Above: what one of them executes at most in each `period`
  Duration period = 0;
  Place place;
};

struct Robot {
  std::string name;
  PolicyKind policy = PolicyKind::RateMonotonic;
  std::vector<CpuSet> cpu_sets;  // at least one
  std::vector<Process> processes;
  std::vector<Threads> threads;
};

/// True if threads execute this task, and not the process's own executor.
[[nodiscard]] bool is_of_threads(const Robot &robot, std::size_t process, TaskId task);

/// True if the process has a task that no threads execute: it runs an executor of ReDAG-RT.
[[nodiscard]] bool has_executor(const Robot &robot, std::size_t process);

}  // namespace redag::robot
