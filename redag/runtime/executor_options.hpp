// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// What an Executor is asked for, what it tells its callbacks, and what it counts. Plain values.
#pragma once

#include <chrono>
#include <cstdint>
#include <exception>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "redag/base/result.hpp"
#include "redag/base/time.hpp"
#include "redag/model/workload.hpp"
#include "redag/sched/config.hpp"

namespace redag::runtime {

using std::chrono::nanoseconds;

/// The preemption mode that an executor has on this machine.
struct Mode {
  PreemptionMode mode = PreemptionMode::None;  // never Auto
  std::string reason;                          // empty: it was asked for
};

/// How long a job may be in progress before watch() names it: the shorter of those that are given.
struct WatchLimits {
  Duration longest = 0;  // 0: not given
  double deadlines = 0;  // so many of its own relative deadline; 0: not given
};

struct WatchdogOptions {
  WatchLimits limits;
  Duration interval = 10 * kMillisecond;  // between two looks
};

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

/// Processor time of a task's jobs that ended.
struct Usage {
  std::uint64_t jobs = 0;
  Duration total = 0;
  Duration longest = 0;
  std::uint64_t over_wcet = 0;
  std::uint64_t over_budget = 0;
  std::uint64_t overdue = 0;  // that watch() named
};

struct TaskStats {
  std::string task;  // "control.ekf"
  sched::Accounting jobs;
  Usage usage;
};

}  // namespace redag::runtime
