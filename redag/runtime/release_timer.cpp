// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/runtime/release_timer.hpp"

#include <algorithm>
#include <utility>

#include "redag/base/lock_guard.hpp"
#include "redag/runtime/clock.hpp"

namespace redag::runtime {
namespace {

constexpr std::size_t kBatch = sched::kMostReleasesAtOnce;  // releases reported as one instant; more follow at once

}  // namespace

ReleaseTimer::ReleaseTimer(Sink sink, std::uint64_t seed) : sink_(std::move(sink)), heap_(seed) {
  due_.reserve(kBatch);
}

ReleaseTimer::~ReleaseTimer() {
  stop();
  join();
}

void ReleaseTimer::add(const Dag &dag, std::span<const TaskId> tasks, Time base) {
  {
    const LockGuard guard(lock_);
    for (std::size_t i = 0; i < dag.tasks.size(); ++i) heap_.add(dag.tasks[i], tasks[i], base);
  }
  parker_.unpark();
}

void ReleaseTimer::remove(std::span<const TaskId> tasks) {
  const LockGuard guard(lock_);
  heap_.remove(tasks);
}

Result<void> ReleaseTimer::start(Time origin, Time horizon, const ThreadSetup &setup) {
  begin(origin, horizon);
  return start(setup);
}

Result<void> ReleaseTimer::start(const ThreadSetup &setup) {
  if (thread_.joinable()) return {};
  return start_thread(setup, [this] { main(); }).map([this](ThreadHandle &&thread) { thread_ = std::move(thread); });
}

void ReleaseTimer::begin(Time origin, Time horizon) {
  {
    const LockGuard guard(lock_);
    origin_ = origin;
    horizon_ = horizon;
  }
  parker_.unpark();
}

void ReleaseTimer::stop() noexcept {
  stopping_.store(true, std::memory_order_release);
  parker_.unpark();
}

void ReleaseTimer::join() {
  if (thread_.joinable()) thread_.join();
}

Time ReleaseTimer::release_due() {
  for (;;) {
    // The lock is held during the report. When remove() gets it, no release of a removed task is under way.
    const LockGuard guard(lock_);
    if (origin_ == kNever) return kNever;
    due_.clear();
    heap_.pop_due(std::min(monotonic_now() - origin_, horizon_ - 1), due_);
    if (due_.empty()) return heap_.next() < horizon_ ? origin_ + heap_.next() : kNever;
    sink_(due_);
  }
}

void ReleaseTimer::main() noexcept {
  for (;;) {
    // Read before the clock: a stop seen here happened before the clock is read. Releases due by then are all reported.
    const bool stopping = stopping_.load(std::memory_order_acquire);
    const Time wake_up = release_due();
    if (stopping) {
      const LockGuard guard(lock_);
      origin_ = kNever;  // other threads release nothing after the timer's end
      return;
    }
    if (wake_up == kNever) {
      parker_.park();
    } else {
      parker_.park_until(wake_up);
    }
  }
}

}  // namespace redag::runtime
