// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Releases timer tasks on their grids, all that are due as one instant. Owns the thread that does it, and a
// ReleaseHeap. add(), remove(), release_due(): any thread. stop(): async-signal-safe.
#pragma once

#include <functional>
#include <span>
#include <string>
#include <vector>

#include "redag/base/pi_mutex.hpp"
#include "redag/base/result.hpp"
#include "redag/base/thread_annotations.hpp"
#include "redag/runtime/release_heap.hpp"
#include "redag/threads/release_thread.hpp"
#include "redag/threads/threads.hpp"

namespace redag::runtime {

class ReleaseTimer {
 public:
  /// Called on the timer's thread or on that of a leader, under the timer's lock. It must not call the timer.
  using Sink = std::function<void(std::span<const Release>)>;

  ReleaseTimer(Sink sink, std::uint64_t seed);

  /// `base` is relative to the `origin` of start(). Call it before or after start(). `is_event`: by task, whether
  /// others release it; empty: no task.
  void add(const Dag &dag, std::span<const TaskId> tasks, Time base, const std::vector<bool> &is_event = {});
  /// When it returns, no release of these tasks is under way or will be reported. Their ids are free.
  void remove(std::span<const TaskId> tasks);

  /// Releases nothing at or after `horizon` (kNever: no end). Error: the thread cannot be set up as asked.
  [[nodiscard]] Result<void> start(Time origin, Time horizon, const ThreadSetup &setup);
  /// The same in two steps: start() creates the thread, which waits for begin(). begin() cannot fail. If there is a
  /// thread already, start() does nothing.
  [[nodiscard]] Result<void> start(const ThreadSetup &setup) { return thread_.start(setup); }
  void begin(Time origin, Time horizon);

  /// For threads that wait in the place of the timer's (Engine::lead()).
  [[nodiscard]] ReleaseThread &thread() { return thread_; }
  /// See ReleaseThread.
  Time release_due() { return thread_.release_due(); }
  void stop() noexcept { thread_.stop(); }
  void join() { thread_.join(); }

 private:
  Time expire();

  const Sink sink_;
  PiMutex lock_{LockClass::Bounded};
  ReleaseHeap heap_ REDAG_GUARDED_BY(lock_);
  std::vector<Release> due_ REDAG_GUARDED_BY(lock_);
  Time origin_ REDAG_GUARDED_BY(lock_) = kNever;  // kNever: before begin()
  Time horizon_ REDAG_GUARDED_BY(lock_) = kNever;
  ReleaseThread thread_;
};

}  // namespace redag::runtime
