// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The threaded runtime: owns the lock around the scheduler, the worker threads, and the rings of events. It reports
// what happens to the scheduler, has its decisions carried out (JobPlacement), and runs the jobs. Others release jobs
// (release timer, rclcpp) and provide the bodies.
//
// Threads: any thread, also a body, may call any member but start(), join(), run_one(), drain(), end_started(),
// wait_idle() and wait_paused(). drain() is for one thread at a time. halt() is async-signal-safe. No
// body has a lock.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "redag/base/atomic.hpp"
#include "redag/base/futex.hpp"
#include "redag/base/histogram.hpp"
#include "redag/base/pi_mutex.hpp"
#include "redag/base/result.hpp"
#include "redag/base/thread_annotations.hpp"
#include "redag/engine/device_threads.hpp"
#include "redag/engine/event_merge.hpp"
#include "redag/engine/in_progress.hpp"
#include "redag/engine/job_body.hpp"
#include "redag/engine/job_placement.hpp"
#include "redag/engine/miss_log.hpp"
#include "redag/engine/shared_order.hpp"
#include "redag/engine/task_table.hpp"
#include "redag/engine/waiting_jobs.hpp"
#include "redag/engine/worker_pool.hpp"
#include "redag/sched/scheduler.hpp"
#include "redag/threads/clock.hpp"
#include "redag/threads/helper_thread.hpp"
#include "redag/threads/parker.hpp"
#include "redag/threads/release_thread.hpp"
#include "redag/threads/setup.hpp"
#include "redag/threads/values.hpp"
#include "redag/trace/ring.hpp"

namespace redag::runtime {

struct Release {
  TaskId task;
  Time nominal = 0;
  Time origin = nominal;  // of the job's data, if that is older
};

struct EngineOptions {
  std::string name = "redag";  // prefix of the threads' names
  sched::Config config;        // the scheduler's configuration; Full means `os`, with max_started threads
  PriorityBand band;           // for os and realtime_threads
  // os, with a policy that rate_of() knows: from start() on, shares one order with the executors that have pages in
  // this folder. `band` must be shared. Empty: has an order of its own.
  std::string order_folder;
  bool realtime_threads = false;   // none, cooperative: all workers at SCHED_FIFO band.top_job
  std::vector<int> cpus;           // processors for the worker threads; empty: any, with `os` m of them
  std::size_t trace_capacity = 0;  // events that the rings hold between two drain(); 0: no events
  ExceptionHandler on_exception;   // empty: exceptions are only counted
  bool measure = false;            // figures() includes responses, execution times and preemptions
  MissLog *misses = nullptr;       // every miss is noted there; must outlive the engine
  // none, cooperative: how many spins a thread without a job makes before it sleeps; see spins_in().
  std::uint32_t spins = 0;
  // none, cooperative: threads besides the workers, for jobs that block in a redag::Blocking. With `os`, each started
  // job has a thread of its own.
  std::uint32_t spare_threads = 0;
  std::size_t touched_stack = 0;  // bytes of each worker thread's stack; see ThreadSetup
  // SCHED_FIFO priority of the threads that wake jobs and serve them at devices; 0: ordinary threads.
  int waits_priority = 0;
};

/// A job that is overdue and has not ended.
struct OverdueJob {
  Job job;
  Duration elapsed = 0;  // since its body began
  Duration used = 0;     // processor time; small if the job blocks or more urgent jobs leave it none
};

/// A job that has started and not ended, and the thread that it is on.
struct StartedJob {
  Job job;
  std::uint32_t thread = 0;  // index among the engine's threads
  bool on_top = false;       // of its thread: the others there wait until it ends
  bool lends = false;        // it has lent its worker: it is in a redag::Blocking
  // Of the topmost job whose body the thread is in; otherwise kNever and 0:
  Time begun = kNever;      // on the engine's clock
  Duration thread_cpu = 0;  // processor time of the thread since it was created
  int thread_id = 0;        // the kernel's number of the thread
};

/// The figures of one task for a live view.
struct TaskFigures {
  sched::Accounting jobs;
  Usage usage;
  int priority = 0;          // os: SCHED_FIFO priority of its jobs that have inherited nothing
  std::uint32_t active = 0;  // jobs that have started and not ended
  std::uint32_t away = 0;    // of these, jobs that wait without a worker
  std::uint32_t ready = 0;
  std::uint32_t most_waits = 0;       // of a job
  Duration longest_waits = 0;         // of a job, together: from each co_await until it is woken
  std::uint64_t kept_worker = 0;      // calls that block for which no thread was left
  std::uint64_t late = 0;             // finished after the deadline
  std::uint64_t late_end_to_end = 0;  // of a sink: finished after the DAG's deadline
  // Zero or null unless EngineOptions::measure is set:
  std::uint64_t preemptions = 0;
  std::shared_ptr<const Histogram> response;    // of finished jobs, from the nominal release
  std::shared_ptr<const Histogram> execution;   // of finished jobs, processor time
  std::shared_ptr<const Histogram> end_to_end;  // of a sink: from the earliest release whose data it carries
};

/// Something that is not as the program asked or as the manual promises.
struct Problem {
  std::string text;
  bool breaks_order = false;  // and still does: a job may have to wait for a less urgent one
};

/// The figures of one worker thread for a live view.
struct ThreadFigures {
  Duration used = 0;  // processor time of the jobs that ended on it
  TaskId task;        // of its topmost job; not valid: it has none
};

struct AddedDag {
  DagId dag;
  std::vector<TaskId> tasks;  // in the DAG's order; consecutive unless ids are reused
};

/// A task to be added on its own: sched::Scheduler::add_task().
struct NewTask {
  DagId dag;
  std::uint32_t rank = 0;
  Task task;
  Body body;
  std::shared_ptr<SkipListener> listener = nullptr;  // if it is not null, the body should own it, too
};

class Engine {
 public:
  Engine(std::unique_ptr<sched::Scheduler> scheduler, EngineOptions options);
  ~Engine();  // halts and joins: waits for the running bodies
  Engine(const Engine &) = delete;
  Engine &operator=(const Engine &) = delete;

  /// Sets the bodies of the tasks with which the scheduler was built, in TaskId order. Call it before start().
  void bind(const Workload &workload, std::vector<Body> bodies);

  /// Creates the threads. Until then no job starts on them, and released jobs wait. The error says what the system
  /// refused, with a hint. After an error no thread is left, and start() can be called again. After success it must not
  /// be. An engine that only uses run_one() needs no start().
  [[nodiscard]] Result<void> start();

  /// Creates the threads that jobs with waits need: one that wakes sleepers, and one for each slot of a device. Call it
  /// before such jobs are released. Later calls do nothing. Error: as start(); it can be called again.
  [[nodiscard]] Result<void> let_wait();

  /// Lets an idle thread wait in the place of the release thread (its leader). Call it before start(). `thread` must
  /// live until join() has returned. With realtime_threads it has no effect: an idle thread is not above busy ones.
  /// With `os` the engine gives the thread its priority from start() on.
  void share_releases(ReleaseThread &thread) { releases_ = options_.realtime_threads ? nullptr : &thread; }

  /// Sets the origin (CLOCK_MONOTONIC) of all times that the scheduler sees. Until then now() is 0. Call it before any
  /// release.
  void set_origin(Time monotonic) noexcept { origin_.store(monotonic, std::memory_order_relaxed); }
  /// Nothing before set_origin().
  [[nodiscard]] std::optional<Time> origin() const noexcept {
    const Time origin = origin_.load(std::memory_order_relaxed);
    return origin == kNever ? std::nullopt : std::optional(origin);
  }
  [[nodiscard]] Time now() const noexcept {
    const Time origin = origin_.load(std::memory_order_relaxed);
    return origin == kNever ? 0 : monotonic_now() - origin;
  }

  /// Releases jobs of timer tasks, all at this instant. More than sched::kMostReleasesAtOnce are split into lots, one
  /// after the other. Decisions are carried out before it returns. Nothing allocates under the lock.
  void release(std::span<const Release> releases);
  /// As above, for a caller that has just read now(): the job arrives at `at`.
  void release(const Release &release, Time at);
  void release(TaskId task, Time nominal) { release(Release{task, nominal}, now()); }
  /// Reports that a message for a data task came at message.nominal (sched::Scheduler::receive); the calling thread
  /// read now() as `at`. A job of this engine that the thread is in sends it.
  void receive(const Release &message, Time at);
  /// Reports that what jobs wait for has happened: a list of waits, by detail::Wait::next, of any engines. Each engine
  /// decides once, when it knows of all its jobs. From any thread.
  static void wake_all(detail::Wait *waits);
  /// Reports releases that are skipped at once for `reason` (sched::Scheduler::miss).
  void miss(std::span<const Release> releases, Reason reason);
  void miss(TaskId task, Time nominal, Reason reason) {
    const Release release{task, nominal};
    miss(std::span(&release, 1), reason);
  }

  /// Reconfiguration while running. All of it allocates under the lock. `bodies` is in the DAG's task order; a DAG can
  /// have no tasks. sched::Scheduler says which tasks can be added and what ids they get.
  AddedDag add_dag(const Dag &dag, std::vector<Body> bodies);
  /// Skips jobs that have not started. A body is destroyed as soon as its last job has ended.
  void remove_dag(DagId dag);
  /// One after the other, but in one decision.
  std::vector<TaskId> add_tasks(std::vector<NewTask> tasks);
  /// As remove_dag(), and cancels the waits of the task's jobs. With reuse_ids, the caller must not use the id from
  /// here on.
  void remove_task(TaskId task);
  void set_predecessors(TaskId task, std::span<const TaskId> predecessors);
  void set_timing(TaskId task, Duration period, Duration deadline);
  /// When set_timing() was last called.
  [[nodiscard]] std::optional<Time> settled() const;

  /// Once it has returned, the scheduler starts no job until resume(). Started jobs continue; a job that a thread was
  /// just given counts as started. Releases are accepted and kept.
  void pause();
  /// While paused, waits until no started job is left. Returns false after `deadline` (CLOCK_MONOTONIC; kNever: no
  /// limit), or if the engine is resumed. Jobs that wait count, and go on when they are woken.
  [[nodiscard]] bool wait_paused(Time deadline);
  /// While paused: the same without a limit, but cancels the waits that there are, and those that begin meanwhile.
  void end_started();
  /// Ends a pause and decides at once.
  void resume();
  /// Starts the most urgent eligible job if a worker is free for it, and runs it to its end on the calling thread, at
  /// that thread's priority. A preemption point in the job only checks its budget. Returns false if there is no such
  /// job. Requires pause(), and that no other run_one() is in progress. Not for jobs that wait.
  bool run_one();

  /// No job starts from now on; started jobs continue. Jobs that were released and have not started stay in flight.
  void halt() noexcept { halting_.store(true, std::memory_order_release); }
  [[nodiscard]] bool halting() const noexcept { return halting_.load(std::memory_order_acquire); }
  /// After halt(): waits until no started job is left. Returns false after `deadline` (CLOCK_MONOTONIC); see started().
  [[nodiscard]] bool wait_idle(Time deadline);
  [[nodiscard]] Time halted_at() const;  // relative to the origin; kNever before halt()
  /// Jobs that have started and not ended.
  [[nodiscard]] std::vector<Job> started() const;
  /// Between start() and join(): replaces `out` by the jobs on the threads, by thread, the topmost one last, and then
  /// those that block on threads of their own. For observers that look from time to time; leaves out the job of
  /// run_one(), and those that wait without a thread.
  void started(std::vector<StartedJob> &out) const;
  /// Calls halt(), and ends the threads once all started jobs have ended. Not from a body.
  void join();

  /// Appends the events since the last call, merged into one stream whose times do not decrease. `last`: no events
  /// follow.
  void drain(std::vector<JobEvent> &out, bool last = false);
  [[nodiscard]] std::uint64_t lost_events() const;

  /// For a watchdog, from time to time between start() and join(). Reports running jobs that have used a limit since
  /// their last preemption point to the scheduler. `on_budget` (except abort) and HI mode then need no preemption
  /// point. Appends jobs that are overdue at `as_of` (relative to the origin), each once.
  void watch(const WatchLimits &limits, Time as_of, std::vector<OverdueJob> &out);

  [[nodiscard]] TaskFigures figures(TaskId task) const;
  /// Replaces `out` by the figures of all worker threads, in their order.
  void figures(std::vector<ThreadFigures> &out) const;
  /// Replaces `out` by the figures of all devices, by DeviceId.
  void figures(std::vector<DeviceFigures> &out) const;
  /// How often a job could have had a processor but waited for a thread, because all threads had jobs.
  [[nodiscard]] std::uint64_t thread_waits() const;
  /// What is not as promised, the worst first. The one list for all front ends.
  [[nodiscard]] std::vector<Problem> problems() const;
  /// Returns true if the calling thread serves a job at one of this engine's devices.
  [[nodiscard]] bool in_service() const { return devices_.is_this_thread(); }
  /// The job that the calling thread runs in this engine, the topmost one of several. Null outside bodies.
  [[nodiscard]] const RunningJob *current_job() const noexcept;
  [[nodiscard]] std::uint32_t thread_count() const { return pool_.size(); }
  [[nodiscard]] const EngineOptions &options() const { return options_; }

 private:
  friend struct RunningJob;
  class Locked;

  Result<void> start_threads(const std::vector<int> &cpus);
  void end_threads();
  void main(WorkerThread &self) noexcept;
  void idle(WorkerThread &self) noexcept;
  void lead(WorkerThread &self) noexcept;
  void follow(WorkerThread &self) noexcept;
  void look_out() noexcept;
  void run(Taker &taker, Time at) noexcept;
  Time run_next(Taker &taker, RunningJob &running, Time at) noexcept;
  sched::Outcome call(const Assignment &assignment, RunningJob &running);
  void end_waits();
  std::optional<Time> suspend(Taker &taker, RunningJob &running);
  Time wake_sleepers();
  void end_service(DeviceThread &thread, JobSlot job);
  void wake(JobSlot job, Time at) REDAG_REQUIRES(lock_);
  detail::Wait *wake_own(detail::Wait *waits);
  void wake_cancelled(Locked &locked, Time at) REDAG_REQUIRES(lock_);
  Time finish(Taker &taker, RunningJob &running, sched::Outcome outcome);
  void finish_special(Locked &locked, RunningJob &running, TaskEntry &entry, sched::Outcome outcome)
      REDAG_REQUIRES(lock_);
  void count_late(const Job &job, TaskEntry &entry, Time at) REDAG_REQUIRES(lock_);
  void note_misses(Locked &locked, const Job &job, const TaskEntry &entry, Time at, sched::Outcome outcome)
      REDAG_REQUIRES(lock_);
  bool lend_worker(RunningJob &running);
  void take_worker(RunningJob &running);
  void preemption_point(RunningJob &job);
  void reach_limit(RunningJob &job, Duration used);

  void report_limits(RunningJob &job, Duration used, Time now) REDAG_REQUIRES(lock_);
  bool tell_limits(RunningJob &job, Duration used, Time now, bool from_outside) REDAG_REQUIRES(lock_);
  void decide(Locked &locked, Time now, Taker *taker = nullptr) REDAG_REQUIRES(lock_);
  void decide_after_release(Locked &locked, Time at, Sender sender, TaskId task) REDAG_REQUIRES(lock_);
  void carry_out(Locked &locked, const sched::Step &step, Time now, Taker *taker, Sender sender = nullptr)
      REDAG_REQUIRES(lock_);
  Sender note_release(Time at) REDAG_REQUIRES(lock_);
  void report(Locked &locked, std::span<const JobEvent> events) REDAG_REQUIRES(lock_);
  void refresh_outranked() REDAG_REQUIRES(lock_);
  void register_task(TaskId id, const Task &task, const TaskRole &role, Body &body,
                     std::shared_ptr<SkipListener> listener = nullptr) REDAG_REQUIRES(lock_);
  void register_dag(DagId id, const Dag &dag, std::span<const TaskId> ids, std::span<Body> bodies)
      REDAG_REQUIRES(lock_);
  void withdraw_if_halting(Locked &locked) REDAG_REQUIRES(lock_) {
    if (halting() && halted_at_ == kNever) withdraw(locked);
  }
  void withdraw(Locked &locked) REDAG_REQUIRES(lock_);
  void wake_pause_waiters() REDAG_REQUIRES(lock_);
  void end_of_jobs() REDAG_REQUIRES(lock_);
  /// Returns true if a thread may begin its next job without carry_out(): preemption points need not know of it.
  [[nodiscard]] bool may_hand_over() const { return options_.config.preemption != sched::Preemption::Cooperative; }
  [[nodiscard]] bool may_start() const REDAG_REQUIRES(lock_) { return running_ && !paused_; }
  [[nodiscard]] std::uint32_t most_to_start() const REDAG_REQUIRES(lock_) { return may_start() ? sched::kNoLimit : 0; }

  [[nodiscard]] bool os() const { return options_.config.preemption == sched::Preemption::Full; }
  [[nodiscard]] bool shares_order() const { return os() && !options_.order_folder.empty(); }
  [[nodiscard]] bool posts_silently() const {
    return (os() || !options_.realtime_threads) && options_.config.workers > 1;
  }

  EngineOptions options_;
  const bool realtime_;  // the threads that run jobs are SCHED_FIFO
  mutable PiMutex lock_;
  std::unique_ptr<sched::Scheduler> scheduler_ REDAG_PT_GUARDED_BY(lock_);
  WorkerPool pool_;
  TaskTable tasks_ REDAG_GUARDED_BY(lock_);
  std::vector<Duration> dag_deadlines_ REDAG_GUARDED_BY(lock_);  // of add_dag(), by DagId
  const std::unique_ptr<HelperThread> lookout_;                  // several ordinary threads
  DeviceThreads devices_;
  WaitingJobs waiting_ REDAG_GUARDED_BY(lock_);
  JobPlacement placement_ REDAG_GUARDED_BY(lock_);
  bool running_ REDAG_GUARDED_BY(lock_) = false;  // the threads have been started
  bool paused_ REDAG_GUARDED_BY(lock_) = false;
  std::uint32_t pause_waiters_ REDAG_GUARDED_BY(lock_) = 0;
  FutexWord pause_changes_{0};  // counts what wait_paused() waits for; written under the lock
  Time halted_at_ REDAG_GUARDED_BY(lock_) = kNever;
  std::optional<Time> settled_ REDAG_GUARDED_BY(lock_);
  trace::Ring decisions_;  // written under the lock
  EventMerge merge_;       // drain() only
  Event idle_event_;
  SharedOrder order_;
  ReleaseThread *releases_ = nullptr;
  std::vector<int> usable_;  // where the thread that called start() may run: a worker may not run everywhere
  bool lets_wait_ = false;   // let_wait() has succeeded
  // let_wait(): wakes jobs that sleep.
  std::unique_ptr<ReleaseThread> sleepers_;
  // let_wait(): calls of wake_all() that may still touch this engine although the woken job has ended.
  std::shared_ptr<InProgress> wakes_;
  Atomic<Time> origin_{kNever};
  Atomic<bool> halting_{false};
  std::atomic<bool> has_listeners_{false};  // a task has or had a listener; written under the lock
};

}  // namespace redag::runtime
