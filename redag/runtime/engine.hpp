// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The threaded runtime: owns worker threads, the lock around the scheduler, and the rings of events; carries out what
// the scheduler decides, and decides nothing. Who releases jobs (release timer, rclcpp) and what jobs do (bodies) is
// given from outside.
//
// Threads: any thread, also a body, may call anything but start(), join(), wait_idle(), wait_paused(), run_one() and
// drain(); drain() is for one thread at a time; halt() is async-signal-safe. No lock is held while a body runs.
#pragma once

#include <atomic>
#include <cstdint>
#include <deque>
#include <exception>
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
#include "redag/runtime/event_merge.hpp"
#include "redag/runtime/executor_options.hpp"
#include "redag/runtime/parker.hpp"
#include "redag/runtime/realtime_share.hpp"
#include "redag/runtime/running_job.hpp"
#include "redag/runtime/setup.hpp"
#include "redag/runtime/thread_priorities.hpp"
#include "redag/sched/scheduler.hpp"
#include "redag/trace/ring.hpp"

namespace redag::runtime {

/// What a body is told.
struct Job {
  TaskId task;
  std::uint32_t number = 0;  // within its task, from 0
  Time release = 0;          // nominal
  JobSlot slot;
  WorkerId worker;  // the scheduler's: threads are not tied to workers; with `os` the first one it was given
};

/// Runs one job. What it throws becomes Outcome::Threw, or BudgetExceeded if it is redag::BudgetExceeded.
using Body = std::function<sched::Outcome(const Job &)>;

/// Told of every exception that left a body, on the worker's thread, before the job counts as ended. Must not throw.
using ExceptionHandler = std::function<void(const Job &, std::exception_ptr)>;

/// Told of each release of a task whose job was skipped before it started, also in the midst of release(); not of
/// miss(). On the thread that had the scheduler decide, without the engine's lock.
class SkipListener {
 public:
  virtual ~SkipListener() = default;
  virtual void skipped(Reason reason) noexcept = 0;
};

struct Release {
  TaskId task;
  Time nominal = 0;
};

struct EngineOptions {
  std::string name = "redag";  // prefix of the threads' names
  sched::Config config;        // what the scheduler was built with; Full means `os`: threads = max_started
  PriorityBand band;           // os, or realtime_threads
  // os: the kernel's. Where there are DAGs of high criticality, jobs of the others leave the real-time class before the
  // kernel takes the processor from all.
  std::optional<Throttling> throttling;
  bool realtime_threads = false;   // none, cooperative: all workers at SCHED_FIFO band.top_job
  std::vector<int> cpus;           // worker threads run there only; empty: anywhere, with `os` on m processors
  std::size_t trace_capacity = 0;  // events the rings hold between two drain(); 0: no events
  ExceptionHandler on_exception;   // empty: exceptions are only counted
  bool start_paused = false;       // as after pause()
  bool measure = false;            // figures() has responses, misses and preemptions
  // none, cooperative: how often a thread without a job looks for one before it sleeps; looks_in().
  std::uint32_t looks = 0;
  std::size_t touched_stack = 0;  // of each worker thread; ThreadSetup
};

/// A job that has not ended although it should have.
struct OverdueJob {
  Job job;
  Duration elapsed = 0;  // since its body began
  Duration used = 0;     // processor time: little where it blocks, or where more urgent jobs leave it none
};

/// What a live view shows of a task.
struct TaskFigures {
  sched::Accounting jobs;
  Usage usage;
  std::uint32_t active = 0;  // jobs that have started and not ended
  std::uint32_t ready = 0;
  // Without EngineOptions::measure nothing:
  std::uint64_t late = 0;  // finished after the deadline
  std::uint64_t preemptions = 0;
  std::shared_ptr<const Histogram> response;  // of finished jobs, from the nominal release
};

struct AddedDag {
  DagId dag;
  std::vector<TaskId> tasks;  // in the DAG's order; consecutive unless ids are reused
};

class Engine {
 public:
  Engine(std::unique_ptr<sched::Scheduler> scheduler, EngineOptions options);
  ~Engine();  // halts and joins: waits for the bodies that run
  Engine(const Engine &) = delete;
  Engine &operator=(const Engine &) = delete;

  /// Gives the tasks that the scheduler was built with their bodies, in TaskId order. Before start().
  void bind(const Workload &workload, std::vector<Body> bodies);

  /// Creates the threads; until then no job starts on them, and what is released waits. Error: what the system refused,
  /// with a hint; no thread is left then, and it may be called again. Once, or never: run_one() needs no threads.
  [[nodiscard]] Result<void> start();

  /// Sets the origin of all times that the scheduler sees (CLOCK_MONOTONIC). Until then now() is 0. Before any release.
  void set_origin(Time monotonic) noexcept { origin_.store(monotonic, std::memory_order_relaxed); }
  [[nodiscard]] Time now() const noexcept;

  /// Jobs of timer tasks are released, all at this instant (more than sched::kMostReleasesAtOnce: one such lot after
  /// the other); decisions are carried out before it returns. Nothing allocates under the lock.
  void release(std::span<const Release> releases);
  void release(TaskId task, Time nominal);
  /// A release that is skipped at once, as `reason` (sched::Scheduler::miss).
  void miss(TaskId task, Time nominal, Reason reason);

  /// Reconfiguration while running; bodies in the DAG's task order, which may be none. All of it allocates under the
  /// lock. Which tasks can be added, and what ids they get: sched::Scheduler.
  AddedDag add_dag(const Dag &dag, std::vector<Body> bodies);
  /// Jobs that have not started are skipped. A body is destroyed as soon as its last job has ended.
  void remove_dag(DagId dag);
  /// `listener`: something that the body owns, too, or null.
  TaskId add_task(DagId dag, std::uint32_t rank, const Task &task, Body body,
                  std::shared_ptr<SkipListener> listener = nullptr);
  /// As remove_dag(). With reuse_ids nobody may use the id from here on.
  void remove_task(TaskId task);
  void set_timing(TaskId task, Duration period, Duration deadline);

  /// From when it returns the scheduler starts no job, until resume(). Jobs that have started go on (one that a thread
  /// was just given counts as started); releases are accepted and kept.
  void pause();
  /// Waits until no started job is left, while paused. False: not by `deadline` (CLOCK_MONOTONIC; kNever: for ever), or
  /// resumed meanwhile.
  [[nodiscard]] bool wait_paused(Time deadline);
  /// Decides at once.
  void resume();
  /// Starts the most urgent eligible job, if there is one and a worker is free for it, and runs it to its end on the
  /// calling thread, at that thread's own priority; a preemption point in it only looks at its budget. False: there was
  /// none. Requires pause(), and that no other run_one() is in progress.
  bool run_one();

  /// No job starts from now on; jobs that have started go on. What was released and has not started stays in flight.
  void halt() noexcept { halting_.store(true, std::memory_order_release); }
  [[nodiscard]] bool halting() const noexcept { return halting_.load(std::memory_order_acquire); }
  /// After halt(): waits until no started job is left. False: not by `deadline` (CLOCK_MONOTONIC); see started().
  [[nodiscard]] bool wait_idle(Time deadline);
  [[nodiscard]] Time halted_at() const;  // on the origin's clock; kNever before
  /// Jobs that have started and not ended.
  [[nodiscard]] std::vector<Job> started() const;
  /// halt(), and ends the threads once all that has started has ended. Not from a body.
  void join();

  /// Appends the events since the last call, merged into one stream whose times do not decrease. `last`: nothing
  /// follows.
  void drain(std::vector<JobEvent> &out, bool last = false);
  [[nodiscard]] std::uint64_t lost_events() const;

  /// For a watchdog, now and then, between start() and join(). Tells the scheduler of running jobs that have used a
  /// limit and have not come to a preemption point since: `on_budget` and HI mode then need not wait for one (being cut
  /// off does). Appends jobs that are in progress for too long at `as_of` (the origin's clock), each once.
  void watch(const WatchLimits &limits, Time as_of, std::vector<OverdueJob> &out);

  [[nodiscard]] sched::Accounting accounting(TaskId task) const;
  [[nodiscard]] Usage usage(TaskId task) const;
  [[nodiscard]] TaskFigures figures(TaskId task) const;
  /// For how long jobs that are not of high criticality had to be ordinary threads, because of throttling.
  [[nodiscard]] Duration gave_way() const;
  /// How often a job could have had a processor, and waited for a thread: all had jobs in progress.
  [[nodiscard]] std::uint64_t thread_waits() const;
  /// Priority changes that the system refused while running (rights were taken away).
  [[nodiscard]] std::uint64_t refused_priorities() const noexcept { return refused_priorities_.load(); }
  /// Is the calling thread inside one of this engine's bodies?
  [[nodiscard]] bool in_body() const noexcept { return current_task().has_value(); }
  /// The task whose job the calling thread runs in this engine, the topmost one of several; nothing outside bodies.
  [[nodiscard]] std::optional<TaskId> current_task() const noexcept;
  [[nodiscard]] std::uint32_t thread_count() const { return static_cast<std::uint32_t>(threads_.size()); }
  [[nodiscard]] const EngineOptions &options() const { return options_; }

 private:
  friend struct RunningJob;
  struct Thread;
  struct ShareKeeper;
  struct TaskEntry;
  struct Assignment;
  struct Next;
  class Locked;

  Result<void> start_threads(const std::vector<int> &cpus);
  void end_threads();
  void main(Thread &self) noexcept;
  void keep_share() noexcept;
  Next run(Thread &self, const Assignment &assignment, JobSlot below, Time &at) noexcept;
  sched::Outcome call(const Assignment &assignment);
  Duration charge(Thread &self, const TaskEntry &entry, const RunningJob &running, Time at) noexcept;
  Next finish(Thread &self, const Assignment &assignment, RunningJob &running, sched::Outcome outcome, Time at,
              Duration used, JobSlot below);
  void preemption_point(RunningJob &job);
  void reach_limit(RunningJob &job, Duration used);

  void report_limits(RunningJob &job, Duration used, Time now) REDAG_REQUIRES(lock_);
  bool tell_limits(RunningJob &job, Duration used, Time now, bool from_outside) REDAG_REQUIRES(lock_);
  Next decide(Locked &locked, Time now, Thread *self, JobSlot below) REDAG_REQUIRES(lock_);
  Next place(Locked &locked, const sched::Step &step, Thread *self, JobSlot below) REDAG_REQUIRES(lock_);
  static const sched::Dispatch *choose_own(const sched::Step &step, JobSlot below);
  Thread *rob(std::uint32_t level) REDAG_REQUIRES(lock_);
  Assignment move_job(Thread &from, Thread &to) REDAG_REQUIRES(lock_);
  Duration look_at_share() REDAG_EXCLUDES(lock_);
  void note_where_realtime_ran() REDAG_REQUIRES(lock_);
  void set_realtime_busy(Time now) REDAG_REQUIRES(lock_);
  [[nodiscard]] std::size_t place_of(const Thread &thread) const REDAG_REQUIRES(lock_);
  void set_priority_for_job(Thread &thread, const Assignment &assignment) REDAG_REQUIRES(lock_);
  [[nodiscard]] bool gives_way(const Thread &thread) const REDAG_REQUIRES(lock_);
  [[nodiscard]] int priority_of(const Thread &thread) const REDAG_REQUIRES(lock_);
  void change_level(const sched::Dispatch &dispatch) REDAG_REQUIRES(lock_);
  Assignment assign(Thread &thread, const sched::Dispatch &dispatch) REDAG_REQUIRES(lock_);
  void hand(Locked &locked, Thread &thread, const Assignment &assignment) REDAG_REQUIRES(lock_);
  void apply(std::span<const ThreadPriorities::Change> changes) REDAG_REQUIRES(lock_);
  void refresh_outranked() REDAG_REQUIRES(lock_);
  void register_task(TaskId id, const Task &task, DagId dag, Body &body,
                     std::shared_ptr<SkipListener> listener = nullptr) REDAG_REQUIRES(lock_);
  void remove_entry(TaskId id, std::vector<Body> &doomed) REDAG_REQUIRES(lock_);
  void withdraw_if_halting() REDAG_REQUIRES(lock_);
  void wake_pause_waiters() REDAG_REQUIRES(lock_);
  /// Some tasks are to be spared when the kernel takes processors away, and others can bear it.
  [[nodiscard]] bool can_give_way() const REDAG_REQUIRES(lock_) { return high_tasks_ > 0 && other_tasks_ > 0; }
  [[nodiscard]] bool may_start() const REDAG_REQUIRES(lock_) { return running_ && !paused_; }

  [[nodiscard]] bool os() const { return options_.config.preemption == sched::Preemption::Full; }
  [[nodiscard]] bool realtime() const { return os() || options_.realtime_threads; }

  EngineOptions options_;
  mutable PiMutex lock_;
  std::unique_ptr<sched::Scheduler> scheduler_ REDAG_PT_GUARDED_BY(lock_);
  std::vector<std::unique_ptr<Thread>> threads_;
  std::unique_ptr<Thread> caller_;                                 // whoever is in run_one()
  std::vector<Thread *> idle_ REDAG_GUARDED_BY(lock_);             // threads without a job, the last one first
  std::vector<Thread *> handed_ REDAG_GUARDED_BY(lock_);           // threads that may have mail; each once
  std::deque<TaskEntry> tasks_ REDAG_GUARDED_BY(lock_);            // by TaskId; entries stay where they are
  std::size_t most_started_ REDAG_GUARDED_BY(lock_) = 0;           // jobs that all tasks together can have in progress
  std::uint32_t unfinished_ REDAG_GUARDED_BY(lock_) = 0;           // jobs dispatched and not ended
  ThreadPriorities priorities_ REDAG_GUARDED_BY(lock_);            // os
  std::optional<RealtimeShare> share_ REDAG_GUARDED_BY(lock_);     // os, throttled
  std::vector<std::size_t> share_places_ REDAG_GUARDED_BY(lock_);  // by processor: its place in `share_`
  std::vector<bool> realtime_on_ REDAG_GUARDED_BY(lock_);          // by place
  bool share_is_kept_ REDAG_GUARDED_BY(lock_) = false;             // somebody looks at it again, without being woken
  bool giving_way_ REDAG_GUARDED_BY(lock_) = false;
  Time giving_way_since_ REDAG_GUARDED_BY(lock_) = 0;
  Duration gave_way_ REDAG_GUARDED_BY(lock_) = 0;       // before that
  std::size_t high_tasks_ REDAG_GUARDED_BY(lock_) = 0;  // of DAGs of high criticality, not removed
  std::size_t other_tasks_ REDAG_GUARDED_BY(lock_) = 0;
  bool running_ REDAG_GUARDED_BY(lock_) = false;  // the threads are there
  bool paused_ REDAG_GUARDED_BY(lock_);
  std::uint32_t pause_waiters_ REDAG_GUARDED_BY(lock_) = 0;
  FutexWord pause_changes_{0};  // counts what wait_paused() waits for; written under the lock
  Time halted_at_ REDAG_GUARDED_BY(lock_) = kNever;
  trace::Ring decisions_;  // written under the lock
  EventMerge merge_;       // drain() only
  Event idle_event_;
  std::unique_ptr<ShareKeeper> share_keeper_;  // os, throttled
  Atomic<Time> origin_{kNever};
  Atomic<bool> halting_{false};
  Atomic<bool> exit_{false};
  std::atomic<bool> has_listeners_{false};  // some task has or had one; written under the lock
  Atomic<std::uint64_t> refused_priorities_{0};
};

}  // namespace redag::runtime
