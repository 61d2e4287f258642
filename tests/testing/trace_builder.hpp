// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Builds traces by hand for tests of their readers: one call per event, times in milliseconds, tasks by name.
#pragma once

#include <string>
#include <utility>

#include "redag/base/check.hpp"
#include "redag/trace/trace.hpp"
#include "redag_analysis/sim/simulator.hpp"

namespace redag::testing {

class TraceBuilder {
 public:
  explicit TraceBuilder(Workload workload) {
    trace_.info.executor = "redag";
    trace_.info.config = sched::config_of(workload);
    trace_.info.preemption = trace::preemption_name(trace_.info.config.preemption);
    trace_.info.workload = std::move(workload);
  }

  /// The events that follow happen at `ms`.
  TraceBuilder &at(Time ms) {
    now_ = ms * kMillisecond;
    return *this;
  }
  /// Released for now, or for `release_ms`.
  TraceBuilder &released(const char *task, std::uint32_t job) { return add(JobEventKind::Released, task, job, now_); }
  TraceBuilder &released_for(const char *task, std::uint32_t job, Time release_ms) {
    return add(JobEventKind::Released, task, job, release_ms * kMillisecond);
  }
  TraceBuilder &ready(const char *task, std::uint32_t job, Time origin_ms) {
    return add(JobEventKind::Ready, task, job, origin_ms * kMillisecond);
  }
  /// Released and ready at once: a timer task without predecessors.
  TraceBuilder &arrives(const char *task, std::uint32_t job) {
    return released(task, job).ready(task, job, now_ / kMillisecond);
  }
  TraceBuilder &deferred(const char *task, std::uint32_t job) { return add(JobEventKind::Deferred, task, job, 0); }
  TraceBuilder &dispatched(const char *task, std::uint32_t job, std::uint32_t worker, Time deadline_ms) {
    return add(JobEventKind::Dispatched, task, job, deadline_ms * kMillisecond, worker);
  }
  TraceBuilder &started(const char *task, std::uint32_t job, std::uint32_t worker) {
    return add(JobEventKind::Started, task, job, now_, worker);
  }
  TraceBuilder &executed(const char *task, std::uint32_t job, std::uint32_t worker, Time used_ms) {
    return add(JobEventKind::Executed, task, job, used_ms * kMillisecond, worker);
  }
  TraceBuilder &preempted(const char *task, std::uint32_t job, std::uint32_t worker) {
    return add(JobEventKind::Preempted, task, job, 0, worker);
  }
  TraceBuilder &resumed(const char *task, std::uint32_t job, std::uint32_t worker) {
    return add(JobEventKind::Resumed, task, job, 0, worker);
  }
  /// Leaves `worker` to wait for a device, or for something else (-1).
  TraceBuilder &waits(const char *task, std::uint32_t job, std::uint32_t worker, std::int64_t device) {
    return add(JobEventKind::Waits, task, job, device, worker);
  }
  TraceBuilder &served(const char *task, std::uint32_t job, std::int64_t device) {
    return add(JobEventKind::Served, task, job, device);
  }
  TraceBuilder &woken(const char *task, std::uint32_t job, std::int64_t device) {
    return add(JobEventKind::Woken, task, job, device);
  }
  TraceBuilder &finished(const char *task, std::uint32_t job, std::uint32_t worker) {
    return add(JobEventKind::Finished, task, job, now_, worker);
  }
  TraceBuilder &aborted(const char *task, std::uint32_t job, std::uint32_t worker, Reason reason) {
    return add(JobEventKind::Aborted, task, job, now_, worker, reason);
  }
  TraceBuilder &exceeded(const char *task, std::uint32_t job) { return add(JobEventKind::Exceeded, task, job, 0); }
  TraceBuilder &high_mode(const char *task, std::uint32_t job) { return add(JobEventKind::HighMode, task, job, 0); }
  TraceBuilder &low_mode(const char *task, std::uint32_t job, Time since_ms) {
    return add(JobEventKind::LowMode, task, job, since_ms * kMillisecond);
  }
  TraceBuilder &skipped(const char *task, std::uint32_t job, Reason reason) {
    return add(JobEventKind::Skipped, task, job, 0, WorkerId::kNoneValue, reason);
  }

  /// Returns the trace of a run that ended at `ms`.
  [[nodiscard]] trace::Trace until(Time ms) const {
    trace::Trace trace = trace_;
    trace.info.end = ms * kMillisecond;
    return trace;
  }

  [[nodiscard]] TaskId id(const std::string &task) const {
    std::size_t index = 0;
    for (const Dag &dag : trace_.info.workload.dags) {
      for (const Task &candidate : dag.tasks) {
        if (candidate.name == task) return TaskId(index);
        ++index;
      }
    }
    REDAG_CHECK(false, "the test's workload has no such task");
    return {};
  }

 private:
  TraceBuilder &add(JobEventKind kind, const char *task, std::uint32_t job, std::int64_t value,
                    std::uint32_t worker = WorkerId::kNoneValue, Reason reason = Reason::None) {
    trace_.events.push_back(JobEvent{now_, value, id(task), job, worker, kind, reason, 0});
    return *this;
  }

  trace::Trace trace_;
  Time now_ = 0;
};

}  // namespace redag::testing
