// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The vocabulary of every trace: what can happen to a job. A stream of events is in decision order, and its times never
// decrease. `value` holds times that were measured more exactly than the decision. Plain values.
#pragma once

#include <cstdint>

#include "redag/base/ids.hpp"
#include "redag/base/time.hpp"

namespace redag {

// Life of a job:
//   Released -> Ready -> Dispatched -> Finished | Aborted
//   Dispatched -> Preempted -> Resumed -> ... -> Finished | Aborted
//   Dispatched -> Waits -> [Served ->] Woken -> Resumed -> ... -> Finished | Aborted
//   Released -> Skipped, Released -> Ready -> Skipped
// Exceeded can happen to a job that has started. HighMode and LowMode happen to the run, and name the job that caused
// them.
// On real threads a job can also end while Preempted, because the operating system ran it meanwhile.
enum class JobEventKind : std::uint8_t {
  Released,    // value: nominal release r, the point on the timer's grid (data tasks: the last predecessor's finish)
  Ready,       // precedence resolved; value: origin, the earliest source release whose data this job carries
  Deferred,    // would have been dispatched, but its DAG is at max_active; at most once for a job
  Dispatched,  // decision: start on `worker`; value: absolute deadline
  Started,     // the body began on `worker` (reported by the driver, not by the scheduler); value: same as time
  Preempted,   // lost `worker` to a higher-priority job
  Resumed,     // continues on `worker`
  Finished,    // value: finish f as measured
  Skipped,     // never started; see reason
  Aborted,     // started and ended without a result; see reason; value: the end as measured
  Exceeded,    // used its budget and was not cut off; its task's `on_budget` follows
  HighMode,    // HI mode begins: this job of a high-criticality DAG used its `wcet_low`
  LowMode,     // HI mode ends: nothing is ready or started; the job is that of HighMode, value: when HI mode began
  Executed,    // the body ended (reported by the driver, before the job's end); value: processor time that it used
  Waits,       // left `worker` to wait; value: the device that it asked, or -1 for none
  Served,      // the device began to serve it; value: the device
  Woken,       // its wait is over, and it needs a worker; value: the device, or -1
};

enum class Reason : std::uint8_t {
  None,
  Overrun,     // Skipped: not started when its task's next job was released
  Precedence,  // Skipped: not ready when its task's next job was released
  QueueFull,   // Skipped: `queue_depth` jobs of its task were waiting
  DagFull,     // Skipped: `max_pending` jobs of its DAG were waiting
  Removed,     // Skipped: its task or its DAG was removed
  Exception,   // Aborted: the body threw
  Budget,      // Aborted: cut off at its budget; Skipped: a job of its task used its budget (skip_next)
  NoData,      // Aborted: it found no data to work on (its message was overwritten, its timer cancelled)
  Degraded,    // Skipped: in HI mode its DAG is degraded
};

inline constexpr auto kLastJobEventKind = JobEventKind::Woken;
inline constexpr auto kLastReason = Reason::Degraded;

/// True for events that the job's thread reports and stamps. They are no decisions, and not in their order.
[[nodiscard]] constexpr bool is_of_body(JobEventKind kind) {
  return kind == JobEventKind::Started || kind == JobEventKind::Executed;
}

/// True for events of the whole run. The job that they name may have ended.
[[nodiscard]] constexpr bool is_mode_change(JobEventKind kind) {
  return kind == JobEventKind::HighMode || kind == JobEventKind::LowMode;
}

/// An event as the rings hold it: 32 bytes, trivially copyable.
struct JobEvent {
  Time time = 0;
  std::int64_t value = 0;
  TaskId task;
  std::uint32_t job = 0;  // number of the job within its task, from 0
  std::uint32_t worker = WorkerId::kNoneValue;
  JobEventKind kind = JobEventKind::Released;
  Reason reason = Reason::None;
  std::uint16_t reserved = 0;

  friend bool operator==(const JobEvent &, const JobEvent &) = default;
};
static_assert(sizeof(JobEvent) == 32);

[[nodiscard]] const char *to_string(JobEventKind kind);
[[nodiscard]] const char *to_string(Reason reason);

}  // namespace redag
