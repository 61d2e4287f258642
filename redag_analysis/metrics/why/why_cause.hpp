// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Why time passed for a job: the vocabulary of explanations (why.hpp). Plain values.
#pragma once

#include <cstdint>

#include "redag/base/ids.hpp"
#include "redag/base/time.hpp"

namespace redag::metrics {

enum class Cause : std::uint8_t {
  // Before it was ready
  ReleaseLate,  // its release was seen after the nominal instant
  HandOver,     // its data was there, and the executor had not passed it on
  Sampling,     // its data was there, and its next release had not come
  Unreleased,   // a predecessor's job that it needs was not released yet
  Predecessor,  // it waited for a predecessor's job, which executed
  // Ready, and not started
  OwnTask,    // an earlier job of its task was not over
  MaxActive,  // its DAG had max_active jobs in progress
  Group,      // another job held its exclusive group
  NoThread,   // all threads had jobs in progress
  Queued,     // the workers ran jobs that are not less urgent
  Blocked,    // a worker ran a less urgent job
  Demoted,    // it was demoted, and a job ran that it would outrank otherwise
  // Started
  Wakeup,        // its body had not begun
  Execution,     // it executed, within its wcet
  Overrun,       // it executed beyond its wcet
  Overhead,      // simulated overheads
  Preempted,     // it had lost its worker to another job
  DeviceQueue,   // it waited for a device, which served another job
  Waited,        // a device served it, or it waited for something else without a worker
  OffProcessor,  // it had a worker and did not execute; the record does not show why
  OnWorker,      // it had a worker; the record does not show whether it executed
  // Lost for a reason that is not where its time went
  Threw,        // its body threw
  BudgetUsed,   // it was cut off at its budget, or skipped because an earlier job had used it
  QueueFull,    // queue_depth jobs of its task were waiting
  PendingFull,  // max_pending jobs of its DAG were waiting
  Degraded,     // its DAG was degraded in HI mode
  Removed,      // its task or DAG was removed
  Unknown,
};

inline constexpr auto kLastCause = Cause::Unknown;

struct JobId {
  TaskId task;
  std::uint32_t number = 0;

  [[nodiscard]] bool valid() const { return task.valid(); }
  friend auto operator<=>(const JobId &, const JobId &) = default;  // NOLINT(modernize-use-nullptr): a false alarm
};

/// A stretch of time and its cause.
struct Part {
  Cause cause = Cause::Unknown;
  JobId job;       // that did not end: the explained job, or one whose data it waited for
  JobId by;        // the job that caused it; invalid: none
  Time begin = 0;  // kNever: only the length is known
  Duration length = 0;

  friend bool operator==(const Part &, const Part &) = default;
};

/// For example "queued".
[[nodiscard]] const char *to_string(Cause cause);

/// True for time in which the job, or on the way of its data a predecessor, did what the workload asks for.
[[nodiscard]] constexpr bool is_work(Cause cause) { return cause == Cause::Execution || cause == Cause::Waited; }

}  // namespace redag::metrics
