// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// A robot (docs/robot.md): the processes of a computer and what else runs there, with a wish for each where it
// belongs in their order. Plain values. robot_yaml.hpp reads them, union.hpp makes one workload of them,
// and plan.hpp the order.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "redag/base/ids.hpp"
#include "redag/base/time.hpp"
#include "redag/model/workload.hpp"

namespace redag::robot {

/// The policy of an order that the bounds decide (N. Audsley's assignment).
inline constexpr const char *kAudsley = "audsley";

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

/// Which processes an entry means. Patterns for glob_match(); an empty one matches all.
struct ProcessMatch {
  std::string name;     // of the program, as ps shows it: at most 15 characters
  std::string command;  // the command line, joined by spaces
  std::string cgroup;   // its path

  [[nodiscard]] bool is_empty() const { return name.empty() && command.empty() && cgroup.empty(); }
};

struct Process {
  std::string name;
  ProcessMatch match;
  std::size_t cpu_set = 0;           // position in Robot::cpu_sets
  std::optional<Workload> workload;  // none: no task of the order
  bool states_workers = false;       // the workload says its number of workers
  Place place;
};

/// A task of a process.
struct TaskOf {
  std::size_t process = 0;  // position in Robot::processes
  TaskId task = {};         // in the process's workload
  std::string name;         // "process.dag.task"
};

/// Data that cross from one process to another: each job of `from` that ends releases one of `to`.
struct Link {
  TaskOf from;
  TaskOf to;               // a timer task without predecessors, of the same period
  Duration transport = 0;  // the longest time from the end of `from` to the release of `to`
  Place place;
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
    Below,        // below all tasks, but above ordinary threads
    Fifo,         // SCHED_FIFO with priority `value`
    Nice,         // ordinary threads with nice `value`
    Reservation,  // SCHED_DEADLINE: before all others, but no longer than `reservation` says
  };
  Kind kind = Kind::Nice;
  TaskOf task = {};  // Task
  Duration rate = 0;
  int value = 0;
  Reservation reservation = {};

  /// True for a level at which the threads can keep tasks waiting that they do not execute.
  [[nodiscard]] bool interferes() const {
    return kind == Kind::Rate || kind == Kind::Above || kind == Kind::Reservation || (kind == Kind::Fifo && value > 1);
  }
};

/// Threads of any process, and what they get.
struct Threads {
  std::string name;
  std::optional<std::size_t> process;  // position in Robot::processes; none: `match`
  ProcessMatch match;
  std::string thread;          // pattern of their names; empty: all
  std::optional<Level> level;  // none: they keep what they have
  std::vector<int> cpus;       // empty: they keep theirs
  std::uint32_t count = 1;     // the most of them that there are, each with `wcet` and `period`
  Duration wcet = 0;           // 0: unknown
  Duration period = 0;
  Place place;

  /// True if the bounds count `count` of these threads.
  [[nodiscard]] bool is_counted() const { return wcet > 0 || (level && level->kind == Level::Kind::Reservation); }
};

/// Interrupts by name, and the processors that serve them.
struct Interrupts {
  std::string name;
  std::string match;  // pattern of the number, or of a name in /proc/interrupts
  std::vector<int> cpus;
  Place place;
};

/// An order found by the bounds (assigned_order.hpp). Places count on each CPU set for itself, 0 is the most urgent.
struct AssignedOrder {
  std::vector<std::vector<std::uint32_t>> of_task = {};       // by process and TaskId
  std::vector<std::optional<std::uint32_t>> of_threads = {};  // by entry; nothing: it has no rate
  std::vector<std::string> tests = {};                        // that decided, each once
  bool found = false;                                         // all units keep their deadlines under the tests
};

struct Robot {
  std::string name;
  PolicyKind policy = PolicyKind::RateMonotonic;
  bool by_bounds = false;                 // policy `audsley`: `assigned` is the order, and `policy` has no meaning
  Place policy_place;                     // if by_bounds
  std::optional<AssignedOrder> assigned;  // nothing: not yet known, or there is none
  std::vector<CpuSet> cpu_sets;           // at least one
  std::vector<Process> processes;
  std::vector<Link> links;
  std::vector<Threads> threads;
  std::vector<Interrupts> interrupts;
};

/// The policy as the file names it.
[[nodiscard]] const char *policy_name(const Robot &robot);

/// The policy by which the executor of a process orders its own tasks.
[[nodiscard]] PolicyKind own_policy(const Robot &robot, std::size_t process);

/// True if threads execute this task, and not the process's own executor.
[[nodiscard]] bool is_of_threads(const Robot &robot, std::size_t process, TaskId task);

/// True if the process has a task that no threads execute: it runs an executor of ReDAG-RT.
[[nodiscard]] bool has_executor(const Robot &robot, std::size_t process);

}  // namespace redag::robot
