// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/runtime/release_timer.hpp"

#include <algorithm>
#include <utility>

#include "redag/base/lock_guard.hpp"
#include "redag/threads/clock.hpp"

namespace redag::runtime {
namespace {

constexpr std::size_t kBatch = sched::kMostReleasesAtOnce;  // releases reported as one instant; more follow at once
// Of one call. Between two calls the thread can be stopped, however late it is.
constexpr Duration kLongest = 100 * kMillisecond;

}  // namespace

ReleaseTimer::ReleaseTimer(Sink sink, std::uint64_t seed)
    : sink_(std::move(sink)), heap_(seed), thread_([this] { return expire(); }) {
  due_.reserve(kBatch);
}

void ReleaseTimer::add(const Dag &dag, std::span<const TaskId> tasks, Time base, const std::vector<bool> &is_event) {
  {
    const LockGuard guard(lock_);
    for (std::size_t i = 0; i < dag.tasks.size(); ++i) {
      if (is_event.empty() || !is_event[i]) heap_.add(dag.tasks[i], tasks[i], base);
    }
  }
  thread_.changed();
}

void ReleaseTimer::remove(std::span<const TaskId> tasks) {
  const LockGuard guard(lock_);
  heap_.remove(tasks);
}

Result<void> ReleaseTimer::start(Time origin, Time horizon, const ThreadSetup &setup) {
  begin(origin, horizon);
  return start(setup);
}

void ReleaseTimer::begin(Time origin, Time horizon) {
  {
    const LockGuard guard(lock_);
    origin_ = origin;
    horizon_ = horizon;
  }
  thread_.changed();
}

Time ReleaseTimer::expire() {
  for (const Time end = monotonic_now() + kLongest;;) {
    // The lock is held during the report. When remove() gets it, no release of a removed task is under way.
    const LockGuard guard(lock_);
    if (origin_ == kNever) return kNever;
    due_.clear();
    const Time now = monotonic_now();
    if (now < end) heap_.pop_due(std::min(now - origin_, horizon_ - 1), due_);
    if (due_.empty()) return heap_.next() < horizon_ ? origin_ + heap_.next() : kNever;
    sink_(due_);
  }
}

}  // namespace redag::runtime
