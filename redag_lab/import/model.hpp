// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Makes the workload of one process of a Recording, with what is assumed and what stays unknown. Pure functions.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "redag/base/result.hpp"
#include "redag/model/workload.hpp"
#include "redag_lab/import/recording.hpp"

namespace redag::lab {

/// What a simulation of the recorded run repeats of a task.
struct Replay {
  Duration offset = 0;               // of the first job, from the begin of the recording
  std::vector<Duration> executions;  // of its jobs by number
  std::vector<Duration> delays;      // of the same, by the executor and the machine
  std::uint32_t rank = 0;            // in the order in which ready callbacks of its kind were taken
  Duration undisturbed = 0;          // an execution that is longer was probably preempted
  std::vector<Duration> gaps;        // of the same before them, beyond the period: as their messages came
  metrics::Distribution responses;   // without values where no event says when a job was released
};

/// A workload, and what its file says in comments.
struct ImportedWorkload {
  Workload workload;
  std::vector<std::vector<std::string>> notes;  // by TaskId
  std::vector<std::string> remarks;             // about all of it
  std::vector<std::string> left_out;            // callbacks without a task, with the reason
  // How much of what the process did the tasks stand for.
  Duration executed = 0;  // of all callbacks
  Duration explained = 0;
  std::uint64_t messages = 0;    // that callbacks took
  std::uint64_t over_edges = 0;  // of these, with an edge from the task that sent them
  std::uint64_t as_sources = 0;  // of these, to tasks with a rate of their own
  // What the simulation of the recorded run needs.
  std::vector<Replay> replays;     // by TaskId
  Duration length = 0;             // of the recording
  Duration overhead = 0;           // of the executor for each job
  bool is_wall_time = true;        // executions contain preemption
  metrics::Distribution wake_ups;  // from release to begin where all threads were idle
};

/// How the messages or requests of a source come.
struct Arrivals {
  Duration period = 0;
  Duration jitter = 0;
  bool sporadic = false;  // `period` is the shortest distance
  std::string note;
};

/// Estimates how often something comes. Requires at least three instants, in any order.
[[nodiscard]] Arrivals estimate_arrivals(std::vector<Time> instants);

/// Makes the workload of a process. Errors: it ran no callback that was seen to be created, or a name is unfit for a
/// file.
[[nodiscard]] Result<ImportedWorkload> import_workload(const Recording &recording, std::uint32_t process);

/// Writes the workload with its notes as comments. Every one of something that is not known has the word "unknown".
[[nodiscard]] std::string to_yaml(const ImportedWorkload &imported);

/// Writes a robot file (docs/robot.md) of several processes, as they would be under ReDAG-RT in `os` mode on `cpus`
/// processors. Requires at least one of each.
[[nodiscard]] std::string to_robot_yaml(std::vector<ImportedWorkload> processes, std::uint32_t cpus);

}  // namespace redag::lab
