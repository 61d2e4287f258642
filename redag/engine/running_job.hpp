// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The job that a thread runs now, for preemption_point() and job_cpu_time(). Internal to the engine. Written by that
// thread. Jobs that follow each other on the thread use one object. A job that waits has another one afterwards.
#pragma once

#include <cstdint>

#include "redag/base/atomic.hpp"
#include "redag/base/time.hpp"
#include "redag/engine/job_body.hpp"
#include "redag/threads/cpu_meter.hpp"

namespace redag::runtime {

class CoroutineOwner;
class Engine;
struct RunningJob;
struct WaitingJob;
struct WorkerThread;

namespace detail {

struct Wait;

// Initial exec: see redag/base/thread_id.hpp.
extern constinit thread_local RunningJob *current_job __attribute__((tls_model("initial-exec")));

}  // namespace detail

struct RunningJob {
  /// `its_job`: where the thread keeps the job that it runs.
  RunningJob(Engine *its_engine, WorkerThread &its_thread, const Job &its_job) noexcept;
  RunningJob(const RunningJob &) = delete;
  RunningJob &operator=(const RunningJob &) = delete;

  // The same for all jobs that follow each other on the thread:
  Engine *const engine;
  const std::uint32_t thread;           // index among the engine's threads
  const Atomic<bool> *const outranked;  // set while a more urgent job could run on top
  RunningJob *const below;
  Atomic<RunningJob *> *const top;  // WorkerThread::top of its thread: points here while the body runs
  const Job &job;                   // another one after each decision for the thread

  // Set by Engine::run_next() for each job:
  Duration limit = kNever;  // processor time of its next limit to check; kNever: none
  Time begun = 0;           // on the engine's clock
  Time here_since = 0;      // on the engine's clock: when it began, or went on after its last wait
  CpuMeter::Start start;    // of its stretch since then; excludes jobs that ran on top
  Duration before = 0;      // processor time until then
  Duration earlier = 0;     // how long it was in progress on threads until then
  bool measured = false;    // its processor time is asked for, however short it was
  // The next seven are unset for each job:
  bool used_wcet_low = false;     // reported to the scheduler; written under the engine's lock
  bool used_budget = false;       // the same
  bool reported = false;          // was reported overdue; written under the engine's lock
  bool cancelled = false;         // it ended because its wait was cancelled
  bool blocks = false;            // it has lent its worker: it is in a redag::Blocking
  bool begins_coroutine = false;  // the body is in the first stretch of a coroutine
  bool has_released = false;      // its body has released a job, first at `released`
  Time released = 0;
  WaitingJob *waiting = nullptr;    // what is kept of it between its waits; null: it has not waited
  detail::Wait *wait = nullptr;     // set by the body when it returns at a co_await; null: it has ended
  CoroutineOwner *owner = nullptr;  // set by the body where it has one: of a coroutine that it may begin
  // Set by end():
  Time ended = 0;         // on the engine's clock
  Duration charged = 0;   // processor time of the whole job
  bool on_trust = false;  // `charged` counts the time that the last stretch took on the clock

  void reach_preemption_point();
  void reach_limit(Duration used);
  /// The body is about to block: other jobs have its worker until take_worker(). Returns false if it keeps it.
  [[nodiscard]] bool lend_worker();
  void take_worker() noexcept;
  /// Processor time until now, never too little. If its start is not exact, at most what the job took on the clock.
  [[nodiscard]] Duration cpu_time() const noexcept { return before + stretch_cpu_time(); }
  /// The same since the job's last wait.
  [[nodiscard]] Duration stretch_cpu_time() const noexcept;
  /// Adds what its last stretch has used to what it had used before, and begins another stretch.
  void charge(Duration stretch) noexcept;
  /// Called when its body has returned. A job that is over within CpuMeter::kShort is charged this time on trust:
  /// asking for its processor time would be a system call.
  void end() noexcept;

  /// watch() may read what the job has used between enter() and leave() only.
  void enter() noexcept { top->store(this, std::memory_order_release); }
  void leave() noexcept { top->store(nullptr, std::memory_order_release); }

  /// The job that the calling thread runs, in any engine.
  static RunningJob *current() noexcept { return detail::current_job; }
  static void set_current(RunningJob *job) noexcept { detail::current_job = job; }
};

}  // namespace redag::runtime
