// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The C++ interface of the threaded runtime: DAGs of functions, executed in priority order until stopped. Owns its
// threads. Behaviour in every corner: docs/runtime.md.
//
// Threads: every member may be called from any thread and from a body, except where it says otherwise;
// request_stop() also from a signal handler. An Executor runs once.
#pragma once

#include <cstdint>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include "redag/base/ids.hpp"
#include "redag/model/job_event.hpp"
#include "redag/runtime/dag_builder.hpp"
#include "redag/runtime/executor_options.hpp"
#include "redag/sched/config.hpp"

namespace redag::runtime {

struct AdmissionRefused : std::runtime_error {
  using std::runtime_error::runtime_error;
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
  [[nodiscard]] bool stopping() const noexcept;

  /// Which preemption mode this is, and why.
  [[nodiscard]] const Mode &mode() const;
  [[nodiscard]] const std::vector<std::string> &warnings() const;
  /// What the scheduler was told: with the events, all that a trace needs.
  [[nodiscard]] const sched::Config &config() const;

  /// Appends the events since the last call; times count from the start. One thread at a time.
  void drain(std::vector<JobEvent> &events);
  /// When the scheduler stopped deciding, on the clock of the events; kNever before. A trace ends there: what happens
  /// to started jobs afterwards follows no rules.
  [[nodiscard]] Time stopped_at() const;
  [[nodiscard]] std::uint64_t lost_events() const;
  /// os: how often a job could have had a processor and waited for a thread, since all had jobs in progress. Above 0, a
  /// less urgent job may have gone first: raise ExecutorOptions::threads.
  [[nodiscard]] std::uint64_t thread_waits() const;
  /// Of a DAG that was removed as long as no later one has its place; with a trace always. Throws std::out_of_range.
  [[nodiscard]] std::vector<TaskStats> stats(DagId dag) const;
  /// "control.ekf"; of a task that was removed as long as none has its id, which is as long as a job of it runs.
  [[nodiscard]] std::string task_name(TaskId task) const;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace redag::runtime
