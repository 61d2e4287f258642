// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The jobs that wait without a worker (docs/model.md, "Waits"), and those that are woken and have none yet. Knows what
// each waits for, begins its wait and can end it early. When a wait ends, it is the engine that tells the
// scheduler. Allocates in reserve(), and where a job waits in a larger slot than any before. Not thread-safe: the
// engine's lock guards it.
#pragma once

#include <cstddef>
#include <vector>

#include "redag/engine/coroutine.hpp"
#include "redag/engine/coroutine_body.hpp"
#include "redag/engine/device_threads.hpp"
#include "redag/engine/job_body.hpp"
#include "redag/engine/running_job.hpp"

namespace redag::runtime {

struct TaskEntry;
struct WorkerThread;

/// A job whose body has waited, from its first wait to its end. While the body runs, its thread alone uses it.
struct WaitingJob {
  Coroutine coroutine;              // the body; awaits others. Empty: another kind of body
  CoroutineOwner *owner = nullptr;  // can be null
  detail::Wait *wait = nullptr;     // what it waits for; its coroutine goes on first. Null: a call that blocks
  WorkerThread *thread = nullptr;   // on which it blocks, and goes on; null: it has none
  // Of the job until its last wait:
  Job job;
  TaskEntry *entry = nullptr;
  Time begun = 0;        // of the body
  Duration charged = 0;  // processor time
  Duration earlier = 0;  // that it was in progress on a thread
  Time since = 0;        // of its last wait
  Duration waited = 0;   // its waits together, queues of devices included
  std::uint32_t waits = 0;
  std::uint32_t level = 0;  // at which it ran
  bool measured = false;
  bool used_wcet_low = false;
  bool used_budget = false;
  bool reported = false;

  // From the pool of frames.
  [[nodiscard]] static void *operator new(std::size_t size);
  static void operator delete(void *storage, std::size_t size) noexcept;
};

class WaitingJobs {
 public:
  explicit WaitingJobs(DeviceThreads &devices) : devices_(devices) {}

  /// Up to `jobs` wait at a time. May be called again with a larger number.
  void reserve(std::size_t jobs);

  /// The job has left its thread, and waits or is woken.
  void add(WaitingJob &job, Time now);
  /// The job has a thread from now on.
  void remove(JobSlot slot) {
    by_slot_[slot.value] = nullptr;
    --count_;
  }
  /// Returns null if that job is none of these.
  [[nodiscard]] WaitingJob *find(JobSlot slot) const {
    return slot.value < by_slot_.size() ? by_slot_[slot.value] : nullptr;
  }
  [[nodiscard]] bool empty() const { return count_ == 0; }
  template <class Function>
  void for_each(Function function) const {
    if (empty()) return;
    for (WaitingJob *job : by_slot_) {
      if (job != nullptr) function(*job);
    }
  }

  /// Begins the wait of a job; at a device it queues first. Returns false if the wait is over already.
  [[nodiscard]] bool begin(detail::Wait &wait);
  /// The wait of a job is over: it is woken. A call that blocks is not begun here, and cannot be cancelled.
  void end(JobSlot slot, Time now);
  /// A device has a slot for the job: a thread of the device begins to serve it. After cancel_all() the job's wait is
  /// cancelled instead.
  void serve(JobSlot slot, int priority, Time now);
  /// A thread of a device has served a job.
  void end_service(DeviceThread &thread, Time now) { devices_.end_service(thread, now); }

  /// When the first sleeper is to be woken (CLOCK_MONOTONIC); kNever: there is none.
  [[nodiscard]] Time next_alarm() const { return sleepers_.empty() ? kNever : sleepers_.front().until; }
  /// Takes the first sleeper, whose wait is over. Not valid: the event that it waits for has just been set, and the
  /// thread that did so wakes it.
  JobSlot take_sleeper();

  /// Cancels all waits but those at devices, and until accept() all that would begin. Jobs that a device serves are
  /// served to the end.
  void cancel_all();
  void accept() { stopped_ = false; }
  /// The same for the jobs of one task, for good: it has been removed (TaskEntry::waits_end).
  void cancel(TaskId task);
  [[nodiscard]] bool has_cancelled() const { return !cancelled_.empty(); }
  /// Takes a job whose wait was cancelled and that is to be woken.
  JobSlot take_cancelled() {
    const JobSlot slot = cancelled_.back();
    cancelled_.pop_back();
    return slot;
  }

 private:
  struct Sleeper {
    Time until = 0;
    JobSlot job;
    // For the standard's heaps, whose top is the largest.
    friend bool operator<(const Sleeper &a, const Sleeper &b) { return a.until > b.until; }
  };
  [[nodiscard]] static bool cancel(detail::Wait *wait);
  void forget_alarm(const detail::Wait &wait, JobSlot slot);
  void add_alarm(const detail::Wait &wait);

  DeviceThreads &devices_;
  std::vector<WaitingJob *> by_slot_;  // null: none of these jobs has the slot
  std::size_t count_ = 0;
  std::vector<Sleeper> sleepers_;   // a heap; also the waits for events that have a limit
  std::vector<JobSlot> cancelled_;  // to be woken
  bool stopped_ = false;
};

}  // namespace redag::runtime
