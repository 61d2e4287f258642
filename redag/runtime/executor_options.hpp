// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The options of an Executor, and the values that it passes to callbacks. Plain values.
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
#include "redag/runtime/stats.hpp"
#include "redag/sched/config.hpp"
#include "redag/threads/values.hpp"

namespace redag::runtime {

using std::chrono::nanoseconds;

/// An exception that left a body.
struct ExceptionInfo {
  std::string task;  // "control.ekf"
  std::uint32_t job = 0;
  std::exception_ptr exception;
};

/// A body that is overdue and has not returned.
struct OverdueInfo {
  std::string task;  // "control.ekf"
  std::uint32_t job = 0;
  Duration elapsed = 0;  // since it was started
  Duration used = 0;     // of that, processor time
  std::string text;      // all of it, for a log
};

/// Decides whether there is time for these DAGs. The DAG to be added is the last of the workload; the others are there.
/// An error says why not.
using AdmissionTest = std::function<Result<void>(const Workload &, const sched::Config &)>;

enum class OnException : std::uint8_t {
  Stop,      // as request_stop(); run(), run_for() or wait() throws the first such exception
  Continue,  // the job counts as aborted and releases no successors; nothing else happens
};

struct ExecutorOptions {
  std::string name = "redag";
  std::uint32_t workers = 0;  // jobs that execute at the same time, at most 4096; 0: one a usable processor
  PreemptionMode preemption = PreemptionMode::Auto;
  PolicyKind policy = PolicyKind::RateMonotonic;
  Ties ties = Ties::Share;  // jobs of equal priority: by earlier release, or by the order of tasks
  /// Jobs that can be started and unfinished at once, with a thread for each. With none and cooperative, those beyond
  /// `workers` are in a redag::Blocking, without a worker. 0: with os workers + 16, else workers. At most 8192.
  std::uint32_t threads = 0;
  std::vector<int> cpus{};  // processors for the workers; empty: os takes `workers` of the usable ones
  /// What the bodies of jobs wait for with DeviceHandle::run(): accelerators and the like. A device serves as many jobs
  /// at a time as it has slots, with a thread for each.
  std::vector<Device> devices{};
  nanoseconds spin{};              // none, cooperative: how long a worker spins before it sleeps
  bool lock_memory = false;        // if refused, warnings() says so
  std::size_t trace_capacity = 0;  // events kept between two drain(); 0: none, or with `record` 32,768
  bool live = false;               // for `redag top`: a page of shared memory, and a thread that updates it
  bool measure = false;            // stats() has distributions of responses, and end to end
  /// os, rate_monotonic or deadline_monotonic: shares one order with the other executors of this user that do so, also
  /// in other processes (docs/robot.md). The variable REDAG_SHARE_ORDER overrides it.
  bool share_order = false;
  /// Called for every deadline miss, on a thread of its own with the priority of the release timer: above all jobs,
  /// and without any lock. It may call every member of the Executor except wait(); stop() only requests the stop. While
  /// it runs, up to 1,024 further misses wait, and more are only counted. An exception stops the executor as that of a
  /// body does, and wait() throws it. Empty: no such thread.
  std::function<void(const MissInfo &)> on_deadline_miss{};
  /// Folder where the run is recorded, for `redag report`, `events`, `why` and `compare`; empty: none. Created if it
  /// is missing. A thread of normal priority writes events to DIR/events.redag while the run lasts, which replaces that
  /// of an earlier run. After a crash, the file has all but the last tenth of a second.
  std::string record{};
  std::uint64_t record_bytes = std::uint64_t{256} << 20U;  // of events on disk; then the newest replace the oldest
  /// Starts a thread that reports bodies which do not return, also while the executor stops. With it, `on_budget`
  /// (except abort) needs no preemption points. Empty: no such thread.
  std::optional<WatchdogOptions> watchdog{};
  // Called on the watchdog's thread, once for each overdue job; must not throw. Empty: prints a line to standard error.
  std::function<void(const OverdueInfo &)> on_overdue{};
  AdmissionTest admission{};  // called by add(); empty: admits all DAGs. See analysis::admit_by_bounds()
  nanoseconds stop_timeout = std::chrono::seconds(10);  // how long stopping waits for bodies to return
  // Called on the worker's thread; must not throw. Empty: OnException::Stop.
  std::function<OnException(const ExceptionInfo &)> on_exception{};
};

}  // namespace redag::runtime
