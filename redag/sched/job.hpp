// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// A live job as the scheduler keeps it: one slot of the job table. Slots are reused, and a slot's content is valid only
// as long as its job lives. Not thread-safe.
#pragma once

#include <cstdint>

#include "redag/base/ids.hpp"
#include "redag/base/time.hpp"

namespace redag::sched {

inline constexpr std::uint32_t kNil = 0xffffffff;  // no slot, in the links of intrusive containers

// Free -> Waiting -> Ready -> Running <-> Suspended -> Free; a skipped job goes from Waiting or Ready to Free.
// Running -> [Queued ->] Away -> Woken -> Running while the job waits without a worker.
enum class JobState : std::uint8_t {
  Free,       // the slot holds no job
  Waiting,    // released; waits for predecessors
  Ready,      // not started; in the ready queue, or parked at a gate that is full
  Running,    // has a worker
  Suspended,  // started, lost its worker: in the ready queue (Full) or under another job on its worker (Cooperative)
  Queued,     // asked a device that does not serve it yet: in the device's queue
  Away,       // a device serves it, or it waits without a device
  Woken,      // its wait is over: in the ready queue
};

// The alignment keeps a job within two cache lines.
struct alignas(32) Job {
  TaskId task;
  std::uint32_t number = 0;
  Time release = 0;
  Time deadline = 0;  // absolute
  Time origin = 0;

  // Jobs are ordered by (key, turn, rank, sequence), smallest first. Under a static policy, key is the task's tier; for
  // a demoted job it is the tier plus the number of tiers. A job that inherits has the more urgent key of another job.
  // Turn, rank and sequence are always the job's own.
  std::int64_t key = 0;
  Time turn = 0;               // Ties::Share: see Lifecycle::turn_of()
  std::uint64_t sequence = 0;  // order in which jobs became ready
  std::uint32_t rank = 0;
  TaskId priority_of{};  // the task whose priority it has: its own, or the task of a job from which it inherited

  // Links of the container that holds the job: the ready queue or a gate's heap.
  std::uint32_t next = kNil;
  std::uint32_t previous = kNil;
  std::uint32_t child = kNil;  // HeapQueue: the first child; LevelQueue: the number of the list
  // The gate where a ready job is parked, or the device of a job that is Queued or Away; kNil: none.
  std::uint32_t parked_at = kNil;

  std::uint32_t task_next = kNil;  // next unstarted job of the same task
  std::uint32_t under = kNil;      // Cooperative: the job suspended below this one
  WorkerId worker{};               // where it runs, or ran last
  JobState state = JobState::Free;
  bool deferred = false;
  bool demoted = false;  // comes after all other jobs, unless it inherits

  [[nodiscard]] bool started() const { return state >= JobState::Running; }
};

static_assert(sizeof(Job) == 96, "a job in at most two cache lines");

/// The total order of jobs: returns true if `a` comes before `b`.
[[nodiscard]] inline bool before(const Job &a, const Job &b) {
  if (a.key != b.key) return a.key < b.key;
  if (a.turn != b.turn) return a.turn < b.turn;
  if (a.rank != b.rank) return a.rank < b.rank;
  return a.sequence < b.sequence;
}

}  // namespace redag::sched
