// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Collects the decisions and events of one step of a scheduler. Not thread-safe.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "redag/sched/job.hpp"
#include "redag/sched/scheduler.hpp"

namespace redag::sched {

class StepBuilder {
 public:
  /// Advances the time to `now`. The first call after read() also begins a new step. Each public call of a scheduler
  /// that reports an event begins with it.
  void begin(Time now) {
    now_ = std::max(now_, now);
    if (!was_read_) return;
    was_read_ = false;
    events_.clear();
    dispatches_.clear();
  }

  /// Returns true if nothing was reported since the last read().
  [[nodiscard]] bool is_new() const { return was_read_; }

  /// Returns the step: the result of dispatch().
  [[nodiscard]] Step read() {
    was_read_ = true;
    return Step{dispatches_, events_};
  }

  [[nodiscard]] Time now() const { return now_; }

  /// Reserves room for the decisions and events of one step.
  void reserve(std::size_t dispatches, std::size_t events) {
    dispatches_.reserve(dispatches);
    events_.reserve(events);
  }

  /// From now on, only events of these kinds are kept.
  void record_only(EventKinds kinds) { recorded_ = kinds; }

  [[gnu::always_inline]] void emit(const Job &job, JobEventKind kind, std::int64_t value,
                                   Reason reason = Reason::None) {
    emit(job.task, job.number, job.worker, kind, value, reason);
  }
  [[gnu::always_inline]] void emit(TaskId task, std::uint32_t number, WorkerId worker, JobEventKind kind,
                                   std::int64_t value, Reason reason = Reason::None) {
    if (recorded_.contains(kind)) record(JobEvent{now_, value, task, number, worker.value, kind, reason, 0});
  }

  [[gnu::always_inline]] void tell(const Job &job, JobSlot slot, DispatchKind kind, JobSlot over, std::uint32_t level) {
    dispatches_.push_back(Dispatch{.job = slot,
                                   .task = job.task,
                                   .number = job.number,
                                   .release = job.release,
                                   .origin = job.origin,
                                   .worker = job.worker,
                                   .over = over,
                                   .kind = kind,
                                   .inherits = job.priority_of != job.task,
                                   .level = level});
  }

  /// Tells that a device begins to serve the job.
  void tell_service(const Job &job, JobSlot slot) {
    Dispatch &told = dispatches_.emplace_back();
    told.job = slot;
    told.task = job.task;
    told.number = job.number;
    told.release = job.release;
    told.origin = job.origin;
    told.kind = DispatchKind::Serve;
  }

  /// Drops the changes of level that the step has for this job.
  void drop_level(JobSlot slot) {
    std::erase_if(dispatches_, [slot](const Dispatch &d) { return d.kind == DispatchKind::Level && d.job == slot; });
  }

  /// Drops all decisions that the step has for this job.
  void drop(JobSlot slot) {
    if (!dispatches_.empty()) drop_all(slot);
  }

 private:
  void record(const JobEvent &event) { events_.push_back(event); }
  [[gnu::noinline]] void drop_all(JobSlot slot) {
    std::erase_if(dispatches_, [slot](const Dispatch &d) { return d.job == slot; });
  }

  std::vector<JobEvent> events_;
  std::vector<Dispatch> dispatches_;
  EventKinds recorded_ = EventKinds::all();
  Time now_ = 0;
  bool was_read_ = false;
};

}  // namespace redag::sched
