// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Collects the decisions and events of one step of a scheduler. Not thread-safe.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <utility>

#include "redag/sched/job.hpp"
#include "redag/sched/scheduler.hpp"

namespace redag::sched {

/// A growing array that is filled anew for each step. Unlike std::vector, it writes an entry to its place without a
/// copy, keeps its size without a division, and does not inline how it grows.
template <class T>
class StepEntries {
 public:
  void reserve(std::size_t count) {
    if (count <= capacity_) return;
    count = std::max(count, capacity_ + capacity_ / 2);  // tasks are added one by one
    auto room = std::make_unique<T[]>(count);
    std::copy_n(room_.get(), count_, room.get());
    room_ = std::move(room);
    capacity_ = count;
  }
  [[nodiscard]] bool empty() const { return count_ == 0; }
  /// Returns all entries, which stay where they are until the next one is added.
  [[nodiscard]] std::span<const T> take() { return {room_.get(), std::exchange(count_, 0)}; }

  [[gnu::always_inline]] void add(const T &entry) {
    if (count_ == capacity_) grow();
    room_[count_++] = entry;
  }
  template <class Predicate>
  void remove_if(Predicate predicate) {
    T *const first = room_.get();
    count_ = static_cast<std::size_t>(std::remove_if(first, first + count_, predicate) - first);
  }

 private:
  [[gnu::noinline]] void grow() { reserve(2 * capacity_ + 16); }

  std::unique_ptr<T[]> room_;  // the first `count_` entries are in use
  std::size_t count_ = 0;
  std::size_t capacity_ = 0;
};

class StepBuilder {
 public:
  /// Advances the time to `now`. Each public call of a scheduler that reports an event begins with it.
  void begin(Time now) {
    now_ = std::max(now_, now);
    is_new_ = false;
  }

  /// Returns true if nothing was reported since the last read().
  [[nodiscard]] bool is_new() const { return is_new_; }

  /// Returns the step, which is the result of dispatch(), and begins a new one.
  [[nodiscard]] Step read() {
    is_new_ = true;
    return Step{dispatches_.take(), events_.take()};
  }

  [[nodiscard]] Time now() const { return now_; }

  /// Reserves room for the decisions and events of one step.
  void reserve(std::size_t dispatches, std::size_t events) {
    dispatches_.reserve(dispatches);
    events_.reserve(events);
  }

  /// From now on, only events of these kinds are kept.
  void record_only(EventKinds kinds) { recorded_ = kinds; }

  [[nodiscard]] bool records(JobEventKind kind) const { return recorded_.contains(kind); }

  [[gnu::always_inline]] void emit(const Job &job, JobEventKind kind, std::int64_t value,
                                   Reason reason = Reason::None) {
    emit(job.task, job.number, job.worker, kind, value, reason);
  }
  [[gnu::always_inline]] void emit(TaskId task, std::uint32_t number, WorkerId worker, JobEventKind kind,
                                   std::int64_t value, Reason reason = Reason::None) {
    if (records(kind)) record(JobEvent{now_, value, task, number, worker.value, kind, reason, 0});
  }

  [[gnu::always_inline]] void tell(const Job &job, JobSlot slot, DispatchKind kind, JobSlot over, std::uint32_t level) {
    dispatches_.add(Dispatch{.job = slot,
                             .task = job.task,
                             .number = job.number,
                             .release = job.release,
                             .origin = job.origin,
                             .worker = job.worker,
                             .over = over,
                             .kind = kind,
                             .level = level});
  }

  /// Tells that a device begins to serve the job.
  void tell_service(const Job &job, JobSlot slot) {
    dispatches_.add(Dispatch{.job = slot,
                             .task = job.task,
                             .number = job.number,
                             .release = job.release,
                             .origin = job.origin,
                             .worker = {},
                             .over = {},
                             .kind = DispatchKind::Serve});
  }

  /// Drops the changes of level that the step has for this job.
  void drop_level(JobSlot slot) {
    dispatches_.remove_if([slot](const Dispatch &d) { return d.kind == DispatchKind::Level && d.job == slot; });
  }

  /// Drops all decisions that the step has for this job.
  void drop(JobSlot slot) {
    if (!dispatches_.empty()) drop_all(slot);
  }

 private:
  void record(const JobEvent &event) { events_.add(event); }
  [[gnu::noinline]] void drop_all(JobSlot slot) {
    dispatches_.remove_if([slot](const Dispatch &d) { return d.job == slot; });
  }

  StepEntries<JobEvent> events_;
  StepEntries<Dispatch> dispatches_;
  EventKinds recorded_ = EventKinds::all();
  Time now_ = 0;
  bool is_new_ = false;
};

}  // namespace redag::sched
