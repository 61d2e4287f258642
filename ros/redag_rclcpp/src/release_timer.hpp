// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// ReleaseTimer releases the jobs of timers when they are due. While it runs, its thread does so, with os above all
// jobs, or an idle worker in its place. Otherwise the thread that pulls jobs calls expire(). Any thread may call it,
// except start() and stop().
#pragma once

#include <atomic>
#include <vector>

#include "redag/base/lock_guard.hpp"
#include "redag/base/pi_mutex.hpp"
#include "redag/base/result.hpp"
#include "redag/engine/engine.hpp"
#include "redag/threads/release_thread.hpp"
#include "timer_queue.hpp"

namespace redag_rclcpp {

class ReleaseTimer {
 public:
  /// `origin`: zero of the engine's clock, on CLOCK_MONOTONIC.
  ReleaseTimer(redag::runtime::Engine &engine, Time origin)
      : engine_(engine), origin_(origin), thread_([this] { return release_due(); }) {}

  [[nodiscard]] TimerQueue &queue() { return queue_; }
  [[nodiscard]] const TimerQueue &queue() const { return queue_; }

  /// The thread, and for workers the way to take its place.
  [[nodiscard]] redag::runtime::ReleaseThread &thread() { return thread_; }

  /// Starts the thread, once. After an error it may be called again.
  [[nodiscard]] redag::Result<void> start(int priority) { return thread_.start({"redag-timer", priority, {}}); }
  /// Ends the thread.
  void stop();

  /// Lets the thread release jobs, or leaves that to expire().
  void resume();
  void pause() { running_ = false; }
  [[nodiscard]] bool is_running() const { return running_; }
  /// Tells the thread that the queue's next() has become earlier.
  void changed() { thread_.changed(); }

  /// Releases what is due. Returns when to call it again; kNever: after a change of the queue.
  Time expire();
  /// Waits until releases that left the queue earlier have been passed on.
  void settle() { const redag::LockGuard guard(expire_lock_); }

 private:
  Time release_due();

  redag::runtime::Engine &engine_;
  const Time origin_;
  TimerQueue queue_;
  std::atomic<bool> running_{false};
  redag::PiMutex expire_lock_;
  std::vector<redag::runtime::Release> due_ REDAG_GUARDED_BY(expire_lock_);
  std::vector<redag::runtime::Release> missed_ REDAG_GUARDED_BY(expire_lock_);
  int in_a_row_ = 0;  // expiries after which the next one was due already; of release_due(), which is never concurrent
  redag::runtime::ReleaseThread thread_;  // last: it uses the others until it is destroyed
};

}  // namespace redag_rclcpp
