// The C++ interface of the threaded runtime: DAGs of functions, executed in priority order until stopped. Owns an
// engine and a release timer. Behaviour in every corner: docs/runtime.md.
//
// Threads: every member may be called from any thread and from a body, except where it says otherwise;
// request_stop() also from a signal handler. An Executor runs once.
#pragma once

#include <chrono>
#include <exception>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include "redag/base/atomic.hpp"
#include "redag/base/mutex.hpp"
#include "redag/base/pi_mutex.hpp"
#include "redag/base/thread_annotations.hpp"
#include "redag/live/publisher.hpp"
#include "redag/runtime/dag_builder.hpp"
#include "redag/runtime/engine.hpp"
#include "redag/runtime/mode.hpp"
#include "redag/runtime/release_timer.hpp"
#include "redag/runtime/watchdog.hpp"

namespace redag::runtime {

/// An exception that left a body.
struct ExceptionInfo {
  std::string task;  // "control.ekf"
  std::uint32_t job = 0;
  std::exception_ptr exception;
};

/// A body that has not returned although it should have.
struct OverdueInfo {
  std::string task;  // "control.ekf"
  std::uint32_t job = 0;
  Duration elapsed = 0;  // since it was started
  Duration used = 0;     // of that, processor time
  std::string text;      // all of it, for a log
};

/// Is there time for these DAGs? The one that is to be added is the last of the workload; the others are there. An
/// error says why not.
using AdmissionTest = std::function<Result<void>(const Workload &, const sched::Config &)>;

enum class OnException : std::uint8_t {
  Stop,      // as request_stop(); run(), run_for() or wait() throws the first such exception
  Continue,  // the job counts as aborted, it releases no successors, and nothing else happens
};

struct ExecutorOptions {
  std::string name = "redag";
  std::uint32_t workers = 0;  // jobs that execute at the same time, at most 4096; 0: one a usable processor
  PreemptionMode preemption = PreemptionMode::Auto;
  PolicyKind policy = PolicyKind::RateMonotonic;
  Ties ties = Ties::Share;         // jobs of equal priority: the earlier release first, or the order of tasks
  std::uint32_t threads = 0;       // os: jobs that can be started and unfinished at once; 0: workers + 16; at most 8192
  std::vector<int> cpus{};         // processors for the workers; empty: os takes `workers` of the usable ones
  nanoseconds spin{};              // none, cooperative: how long a worker looks for a job before it sleeps
  bool lock_memory = false;        // if it cannot be had, warnings() says so
  std::size_t trace_capacity = 0;  // events kept between two drain(); 0: none are recorded
  bool live = false;               // `redag top` sees it: a page of shared memory, and a thread that updates it
  /// A thread that looks for bodies that do not return, also while the executor stops; and `on_budget` then needs no
  /// preemption points. None: no such thread.
  std::optional<WatchdogOptions> watchdog{};
  // Called on the watchdog's thread, once for each such job; must not throw. Empty: a line on standard error.
  std::function<void(const OverdueInfo &)> on_overdue{};
  AdmissionTest admission{};  // asked by add(); empty: everything is admitted. See analysis::admit_by_bounds()
  nanoseconds stop_timeout = std::chrono::seconds(10);  // how long stopping waits for bodies to return
  // Called on the worker's thread; must not throw. Empty: Stop.
  std::function<OnException(const ExceptionInfo &)> on_exception{};
};

struct AdmissionRefused : std::runtime_error {
  using std::runtime_error::runtime_error;
};

struct TaskStats {
  std::string task;  // "control.ekf"
  sched::Accounting jobs;
  Usage usage;
};

class Executor {
 public:
  /// Throws std::invalid_argument for an option out of its range; std::runtime_error if preemption `os` is asked for
  /// and cannot be had; the text says how to get it.
  explicit Executor(ExecutorOptions options = {});
  /// Stops, and waits for the bodies that run, however long they take.
  ~Executor();
  Executor(const Executor &) = delete;
  Executor &operator=(const Executor &) = delete;

  /// Adds a DAG, before or while running; its release grid begins at the start, or now. Throws std::invalid_argument
  /// with all mistakes if it is not valid or another DAG here has its name, AdmissionRefused with the reason if
  /// `admission` says no; nothing is changed then. Ids of DAGs are not used again.
  DagId add(DagBuilder dag);
  /// What has not started is skipped, what has started ends as usual; a body is destroyed once it no longer runs. Does
  /// nothing the second time. Throws std::out_of_range if there has been no such DAG.
  void remove(DagId dag);

  /// start(), and wait(). Throws what start() and wait() throw.
  void run();
  /// As run(), for at most `duration`. Throws std::invalid_argument if that is negative.
  void run_for(nanoseconds duration);

  /// Returns when all threads are ready. Throws std::runtime_error if the system refuses a thread, and can be called
  /// again then; std::logic_error if it has been started.
  void start();
  /// Waits until somebody stops the executor and all bodies have returned; then throws the exception that stopped it,
  /// if one did. Throws std::runtime_error that names the bodies which run on after stop_timeout. Not from a body.
  void wait();
  /// request_stop(), and waits as wait() does, but throws no body's exception. From a body: request_stop() alone.
  void stop();
  /// No job starts from now on. Async-signal-safe.
  void request_stop() noexcept;
  [[nodiscard]] bool stopping() const noexcept { return engine_->halting(); }

  /// Which preemption mode this is, and why.
  [[nodiscard]] const Mode &mode() const { return setup_.mode; }
  [[nodiscard]] const std::vector<std::string> &warnings() const { return setup_.warnings; }
  /// What the scheduler was told: with the events, all that a trace needs.
  [[nodiscard]] const sched::Config &config() const { return engine_->options().config; }

  /// Appends the events since the last call; times count from the start. One thread at a time.
  void drain(std::vector<JobEvent> &events);
  /// When the scheduler stopped deciding, on the clock of the events; kNever before. A trace ends there: what happens
  /// to started jobs afterwards follows no rules.
  [[nodiscard]] Time stopped_at() const { return engine_->halted_at(); }
  [[nodiscard]] std::uint64_t lost_events() const { return engine_->lost_events(); }
  /// os: how often a job could have had a processor and waited for a thread, since all had jobs in progress. Above 0, a
  /// less urgent job may have gone first: raise ExecutorOptions::threads.
  [[nodiscard]] std::uint64_t thread_waits() const { return engine_->thread_waits(); }
  /// Of a DAG that was removed as long as no later one has its place; with a trace always. Throws std::out_of_range.
  [[nodiscard]] std::vector<TaskStats> stats(DagId dag) const;
  /// "control.ekf"; of a task that was removed as long as none has its id, which is as long as a job of it runs.
  [[nodiscard]] std::string task_name(TaskId task) const;

 private:
  struct Added {
    std::string name;
    std::vector<Task> tasks;
    std::uint32_t max_active = 0;
    AddedDag ids;          // the engine's
    std::size_t left = 0;  // of the tasks' ids, those that no later task has
    bool removed = false;
    Dag dag;  // for `admission` only
  };
  struct Owner {
    DagId dag;  // ours
    std::uint32_t position = 0;
    Time since = 0;  // jobs that were released earlier are another task's, which had the id
  };
  void finish();
  void admit(const Dag &dag) const REDAG_REQUIRES(lock_);
  void on_overdue(const OverdueJob &job);
  [[nodiscard]] Result<void> start_threads();
  [[nodiscard]] Result<void> start_watchdog();
  void sample(live::Sample &sample) const;
  void on_exception(const Job &job, std::exception_ptr exception);
  void own(DagId dag, const std::vector<TaskId> &tasks, Time since) REDAG_REQUIRES(lock_);
  [[nodiscard]] std::string name_of(const Owner &owner) const REDAG_REQUIRES(lock_);

  ExecutorOptions options_;
  Setup setup_;
  std::unique_ptr<Engine> engine_;
  std::unique_ptr<ReleaseTimer> timer_;
  std::unique_ptr<Watchdog> watchdog_;  // from start() until no body is left
  mutable PiMutex lock_;
  // Without a trace the engine uses ids again, so that memory does not grow with the DAGs there have been.
  std::map<std::uint32_t, Added> dags_ REDAG_GUARDED_BY(lock_);  // by DagId
  std::uint32_t next_dag_ REDAG_GUARDED_BY(lock_) = 0;
  std::vector<Owner> owners_ REDAG_GUARDED_BY(lock_);   // by TaskId
  std::exception_ptr failure_ REDAG_GUARDED_BY(lock_);  // the first that stopped us
  bool running_ REDAG_GUARDED_BY(lock_) = false;
  Mutex finishing_;  // one thread at a time begins or ends the run
  Atomic<bool> started_{false};
  Atomic<bool> finished_{false};
  Event stop_;
  std::unique_ptr<live::Publisher> live_;  // last: it asks for figures until it is gone
};

}  // namespace redag::runtime
