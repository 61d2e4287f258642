// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The threads that run jobs, from their creation to their end. Which job a thread has is JobPlacement's business.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <vector>

#include "redag/base/atomic.hpp"
#include "redag/base/result.hpp"
#include "redag/engine/job_body.hpp"
#include "redag/engine/running_job.hpp"
#include "redag/engine/task_table.hpp"
#include "redag/threads/cpu_meter.hpp"
#include "redag/threads/parker.hpp"
#include "redag/threads/threads.hpp"
#include "redag/trace/ring.hpp"

namespace redag::runtime {

/// A job on its way to a thread.
struct Assignment {
  Job job;
  TaskEntry *entry = nullptr;   // keeps its address; its body is not touched while `busy`
  WaitingJob *woken = nullptr;  // the job has waited and goes on; null: it begins
  bool expected_short = false;
};

/// Members marked `lock` are guarded by the engine's lock.
struct alignas(64) WorkerThread {
  WorkerThread(std::uint32_t its_index, std::size_t trace_capacity) : index(its_index), events(trace_capacity) {}

  /// Takes the mail; returns true for one caller only.
  bool take_mail() noexcept {
    return has_mail.load(std::memory_order_relaxed) && has_mail.exchange(false, std::memory_order_acquire);
  }

  /// Sleeps until its job, which has blocked or yielded, has a worker again.
  void wait_for_worker() noexcept {
    do {
      parker.park();
    } while (!goes_on.exchange(false, std::memory_order_acquire));
  }

  std::uint32_t index;
  Parker parker;
  // Written under the lock, by the thread that dispatches, while this thread has no job. Read by the thread that took
  // it: this one, without the lock, or one that steals it before this one is awake, under the lock.
  Assignment mail;
  Atomic<bool> has_mail{false};
  Atomic<bool> leads{false};    // waits for releases when it is idle; written under the lock
  Atomic<Time> wakes_at{0};     // of the leader, on the engine's clock; 0: it is awake; written by the thread
  Atomic<bool> goes_on{false};  // its job, which has blocked or yielded, has a worker again; written under the lock
  bool yields = false;          // lock: a job on another thread has preempted its job
  bool led = false;             // used by the thread only: the release thread leaves releases to it
  bool is_handed = false;       // lock: is in Mailboxes::handed_
  bool looks_soon = false;      // lock: its job is expected to end soon, and it looks for others' mail afterwards
  // lock: a number if its mail did not wake it, and 0 otherwise. Larger numbers are later.
  std::uint64_t silent = 0;
  std::uint32_t level = 0;        // lock: of the job that it was given last; inherited only with `os`
  Duration used = 0;              // lock: processor time of the jobs that ended here
  Atomic<bool> outranked{false};  // written under the lock
  std::vector<Job> stack;         // lock: the jobs started here, the running one last
  trace::Ring events;             // Started and Executed; written by the thread
  CpuMeter meter;                 // used by the thread only
  // The topmost job whose body the thread is in; null once the body has returned. Written by the thread. What it points
  // to stays valid under the lock, because a job's end takes the lock after clearing this.
  Atomic<RunningJob *> top{nullptr};

  ThreadHandle handle;
  clockid_t cpu_clock = 0;            // of `handle`; set before the engine runs
  ProcessorWord processor = nullptr;  // lock: of `handle`, while the engine runs
};

class WorkerPool {
 public:
  /// Each thread's ring holds up to `trace_capacity` events.
  WorkerPool(std::uint32_t threads, std::size_t trace_capacity);

  /// Creates the threads, which run `main` and are set up like `setup`; its name is the prefix of theirs. Error: what
  /// the system refused; threads can be left, call end().
  [[nodiscard]] Result<void> start(ThreadSetup setup, const std::function<void(WorkerThread &)> &main);
  /// Tells the threads to end, and waits for them. Those that have mail run it first.
  void end();
  /// After end(): start() can be called again.
  void reset() { ending_.store(false, std::memory_order_release); }
  [[nodiscard]] bool ending() const { return ending_.load(std::memory_order_acquire); }

  [[nodiscard]] std::uint32_t size() const { return static_cast<std::uint32_t>(threads_.size()); }
  [[nodiscard]] WorkerThread &operator[](std::size_t index) { return *threads_[index]; }
  [[nodiscard]] const std::vector<std::unique_ptr<WorkerThread>> &threads() const { return threads_; }
  /// Stands for the thread in Engine::run_one().
  [[nodiscard]] WorkerThread &caller() { return caller_; }
  [[nodiscard]] const WorkerThread &caller() const { return caller_; }
  /// The threads no longer say where they run, because they are about to end. Under the engine's lock.
  void forget_processors();

 private:
  std::vector<std::unique_ptr<WorkerThread>> threads_;
  WorkerThread caller_;
  Atomic<bool> ending_{false};
};

}  // namespace redag::runtime
