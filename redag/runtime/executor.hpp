// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The C++ interface of the threaded runtime: executes DAGs of functions in priority order until stopped. Owns its
// threads. docs/runtime.md describes every corner case. An Executor runs once.
//
// Threads: every member may be called from any thread and from a body, unless it says otherwise. request_stop() may
// also be called from a signal handler.
#pragma once

#include <csignal>
#include <cstdint>
#include <initializer_list>
#include <memory>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "redag/base/ids.hpp"
#include "redag/model/job_event.hpp"
#include "redag/runtime/dag_builder.hpp"
#include "redag/runtime/device_handle.hpp"
#include "redag/runtime/executor_options.hpp"
#include "redag/runtime/stats.hpp"
#include "redag/sched/config.hpp"

namespace redag::runtime {

struct AdmissionRefused : std::runtime_error {
  using std::runtime_error::runtime_error;
};

class Executor {
 public:
  /// Throws std::invalid_argument for an option out of its range. Throws std::runtime_error if preemption `os` is asked
  /// for and not available, or if the folder of `record` cannot be written; its text says how to mend it.
  explicit Executor(ExecutorOptions options = {});
  /// Stops, and waits for the running bodies without a limit.
  ~Executor();
  Executor(const Executor &) = delete;
  Executor &operator=(const Executor &) = delete;

  /// Adds a DAG before or during the run. Its release grid begins at the start of the run, or now. Throws
  /// std::invalid_argument with all mistakes of the DAG, also if its name is taken. Throws AdmissionRefused with the
  /// reason if `admission` refuses it, and std::runtime_error if it is the first one with a Coroutine and the system
  /// refuses a thread. Changes nothing if it throws. Ids of DAGs are not used again.
  DagId add(DagBuilder dag);
  /// Skips jobs that have not started. Started jobs end as usual, and a body is destroyed once it no longer runs. A
  /// second call does nothing. Throws std::out_of_range if there has been no such DAG.
  void remove(DagId dag);

  /// A device of ExecutorOptions::devices, for bodies that wait (docs/runtime.md, "Bodies that wait"). Throws
  /// std::out_of_range if there is none of this name. Bodies must not outlive the executor with it.
  [[nodiscard]] DeviceHandle device(std::string_view name) const;

  /// Releases a job of a task that DagBuilder::event() added, now. All rules for releases hold: overrun, max_pending,
  /// max_active, HI mode. Returns false if no job is released, because the minimum inter-arrival time has not passed
  /// (EarlyRelease::Skip), or the executor is not running. Throws std::logic_error if this executor does not have the
  /// task. Takes the engine's lock and wakes threads; allocates nothing. From any thread and any body, but not from a
  /// signal handler.
  bool release(const EventHandle &event);

  /// Calls start() and wait(), and throws what they throw.
  void run();
  /// As run(), for at most `duration`. Throws std::invalid_argument if `duration` is negative.
  void run_for(nanoseconds duration);
  /// As run(), and stops at the first of these signals. Returns its number, or 0 if something else stopped the
  /// executor. A second signal, more than 0.2 s later, has its default effect: it ends the process. A signal that the
  /// process ignores stays ignored. The previous handlers are back when it returns or throws. Throws std::logic_error
  /// if another executor of the process is in this function.
  int run_until_signal(std::initializer_list<int> signals = {SIGINT, SIGTERM});

  /// Returns when all threads are ready. Throws std::runtime_error if the system refuses a thread, and can then be
  /// called again. Throws std::logic_error if the executor has already been started.
  void start();
  /// Waits until the executor is stopped and all bodies have returned. Then throws the exception that stopped it, if
  /// there is one. Throws std::runtime_error that names the bodies which still run after stop_timeout. Not from a body.
  void wait();
  /// Calls request_stop() and waits as wait() does, but throws no body's exception. From a body it only requests the
  /// stop.
  void stop();
  /// No job starts from now on. Async-signal-safe.
  void request_stop() noexcept;
  [[nodiscard]] bool stopping() const noexcept;

  /// The preemption mode, and why.
  [[nodiscard]] const Mode &mode() const;
  /// What is not as asked for or promised, so far. Any thread, at any time.
  [[nodiscard]] std::vector<std::string> warnings() const;
  /// The scheduler's configuration. With the events it is all that a trace needs.
  [[nodiscard]] const sched::Config &config() const;

  /// Appends the events since the last call. Times count from the start. For one thread at a time. Throws
  /// std::logic_error with ExecutorOptions::record, which takes the events.
  void drain(std::vector<JobEvent> &events);
  /// When the scheduler stopped deciding, on the clock of the events; kNever before. A trace ends there, because later
  /// events of started jobs follow no rules.
  [[nodiscard]] Time stopped_at() const;
  [[nodiscard]] std::uint64_t lost_events() const;
  /// os: how often a job could have had a processor but waited for a thread, because all had jobs. Above 0, a less
  /// urgent job may have gone first: raise ExecutorOptions::threads.
  [[nodiscard]] std::uint64_t thread_waits() const;
  /// Also for a removed DAG until its slot is reused (never when tracing). Throws std::out_of_range otherwise.
  [[nodiscard]] std::vector<TaskStats> stats(DagId dag) const;
  /// The same, and the DAG's answers end to end.
  [[nodiscard]] DagStats dag_stats(DagId dag) const;
  /// For example "control.ekf". Also for a removed task until its id is used again, which is not before its last job
  /// ends.
  [[nodiscard]] std::string task_name(TaskId task) const;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace redag::runtime
