// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// A recorded run: its events in decision order, and what a reader must know to judge them (RunInfo). Plain values; see
// events_file.hpp and docs/events.md for the files.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "redag/base/time.hpp"
#include "redag/loader/provenance.hpp"
#include "redag/model/job_event.hpp"
#include "redag/model/workload.hpp"
#include "redag/sched/scheduler.hpp"

namespace redag::trace {

/// What drove the run, and who recorded it. All drivers but the simulator use a real clock: times have noise, and
/// decisions of one instant are some nanoseconds apart.
enum class Driver : std::uint8_t {
  Simulator,  // virtual time: exact, and equal for equal seeds
  Threads,    // the threaded runtime
  Ros,        // our executor under rclcpp: timers have no common grid, and messages release jobs
  RosNodes,   // callbacks of ROS 2 nodes on any executor: starts and ends are recorded, but no decisions
};

/// The machine of a real-time run; default values if unknown.
struct Machine {
  std::uint32_t cpus = 0;  // processors the run could use; 0: unknown
  std::string kernel;      // "Linux 6.1.0-rt7 x86_64"
  std::string model;       // processor's name

  friend bool operator==(const Machine &, const Machine &) = default;
};

/// Times of a trace are at most this far from 0 (73 years). No difference of two times, or of a time and the latest
/// deadline, overflows.
inline constexpr Time kMaxTraceTime = kMaxDuration / 2;

/// What an observer of the run noticed and its events do not show, for instance a deadlock.
struct Remark {
  Time begun = 0;
  Time ended = kNever;  // kNever: it lasted until the end of the run
  std::string text;

  friend bool operator==(const Remark &, const Remark &) = default;
};

/// A task that was removed while the run went on.
struct Removal {
  TaskId task;
  Time at = 0;  // from then on, nothing releases it

  friend bool operator==(const Removal &, const Removal &) = default;
};

/// A predecessor of a ROS 2 callback that the executor had it wait for, from `since` to `until` (kNever: to the end).
struct Edge {
  TaskId from;
  TaskId to;
  Time since = 0;
  Time until = kNever;

  friend bool operator==(const Edge &, const Edge &) = default;
};

struct RunInfo {
  Workload workload;           // task ids of the events are indices in it
  std::string executor;        // "redag", "mte", "ste", ...
  sched::Config config;        // the scheduler's configuration
  std::string preemption;      // the mode that really ran: "none", "cooperative", "os", "full"
  std::string preemption_why;  // why this mode; empty: it was asked for
  Driver driver = Driver::Simulator;
  std::uint64_t seed = 0;
  Time start = 0;                 // origin of the release grid: job k of a timer is released at start + offset + k * T
  Time end = 0;                   // horizon: nothing is released at or after it. A record that was cut has all
                                  // events up to this instant, and none of later ones
  Duration warm_up = 0;           // jobs released before start + warm_up are not counted
  bool stepped = false;           // at times no job could start, or one at a time: a free worker proves nothing
  std::uint64_t lost_events = 0;  // dropped by full rings: the stream has holes if > 0
  std::string overheads;  // overheads that the driver added to execution; empty: none (the model's ideal machine)
  Machine machine;
  Provenance provenance;  // of the program that ran it; unknown in files from before this block existed
  std::vector<Remark> remarks;
  std::vector<TaskId> event_tasks;  // timer tasks that the program releases: no grid, at least a period apart
  std::vector<Removal> removals;
  std::vector<Edge> edges;     // of callbacks; `workload` has the edges of all other tasks
  std::optional<Time> origin;  // on threads: CLOCK_MONOTONIC at time 0
  // When rates, deadlines or levels last changed: `workload` says what held from then on. Earlier events are not held
  // to rules that follow from these.
  std::optional<Time> settled;
};

/// Returns the workers of the run. For ROS 2 nodes, config.workers counts the threads that executed callbacks. With
/// preemption `os` these are more than ran at the same time, and their number differs between repetitions.
[[nodiscard]] inline std::uint32_t worker_count(const RunInfo &info) {
  return info.driver == Driver::RosNodes ? info.workload.platform.workers : info.config.workers;
}

struct Trace {
  RunInfo info;
  std::vector<JobEvent> events;
};

/// Returns true if differences of the event's times cannot overflow. Readers must check it.
[[nodiscard]] bool has_valid_times(const JobEvent &event);

[[nodiscard]] const char *to_string(Driver driver);
[[nodiscard]] const char *preemption_name(sched::Preemption mode);

/// For example "control.ekf" (DAG and task); "task 17" if there is no such task.
[[nodiscard]] std::string task_name(const Workload &workload, TaskId task);

}  // namespace redag::trace
