// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// One thread that releases timer tasks on their grids. It sleeps until the next release (absolute, CLOCK_MONOTONIC) and
// reports all due releases as one instant. It does not wake up while there is nothing to release. Owns its thread and a
// ReleaseHeap. add(), remove(), release_due(): any thread. stop(): async-signal-safe.
#pragma once

#include <functional>
#include <span>
#include <string>
#include <vector>

#include "redag/base/atomic.hpp"
#include "redag/base/pi_mutex.hpp"
#include "redag/base/result.hpp"
#include "redag/base/thread_annotations.hpp"
#include "redag/runtime/parker.hpp"
#include "redag/runtime/release_heap.hpp"
#include "redag/runtime/threads.hpp"

namespace redag::runtime {

class ReleaseTimer {
 public:
  /// Called on the timer's thread or by release_due(), under the timer's lock. It must not call the timer.
  using Sink = std::function<void(std::span<const Release>)>;

  ReleaseTimer(Sink sink, std::uint64_t seed);
  ~ReleaseTimer();  // stops and joins
  ReleaseTimer(const ReleaseTimer &) = delete;
  ReleaseTimer &operator=(const ReleaseTimer &) = delete;

  /// `base` is relative to the `origin` of start(). Call it before or after start().
  void add(const Dag &dag, std::span<const TaskId> tasks, Time base);
  /// When it returns, no release of these tasks is under way or will be reported. Their ids are free.
  void remove(std::span<const TaskId> tasks);

  /// Releases nothing at or after `horizon` (kNever: no end). Error: the thread cannot be set up as asked.
  [[nodiscard]] Result<void> start(Time origin, Time horizon, const ThreadSetup &setup);
  /// The same in two steps: start() creates the thread, which waits for begin(). begin() cannot fail. If there is a
  /// thread already, start() does nothing.
  [[nodiscard]] Result<void> start(const ThreadSetup &setup);
  void begin(Time origin, Time horizon);

  /// Reports what is due, as the timer's thread does. For threads that have nothing else to do. Returns when the next
  /// release is due (CLOCK_MONOTONIC); kNever: none is known, or the timer has not begun or has ended.
  Time release_due();

  /// Ends the releases at this moment. Releases that were due before are still reported.
  void stop() noexcept;
  /// Waits for the thread, after stop().
  void join();

 private:
  void main() noexcept;

  Sink sink_;
  PiMutex lock_;
  ReleaseHeap heap_ REDAG_GUARDED_BY(lock_);
  std::vector<Release> due_ REDAG_GUARDED_BY(lock_);
  Parker parker_;
  Atomic<bool> stopping_{false};
  Time origin_ REDAG_GUARDED_BY(lock_) = kNever;  // kNever: before begin(), and after the thread's end
  Time horizon_ REDAG_GUARDED_BY(lock_) = kNever;
  ThreadHandle thread_;
};

}  // namespace redag::runtime
