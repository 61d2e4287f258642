// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// ReleaseTimer releases the jobs of timers when they are due. While it runs, its thread does so, with os above all
// jobs. Otherwise the thread that pulls jobs calls expire(). Any thread may call it, except start() and stop().
#pragma once

#include <atomic>
#include <thread>
#include <vector>

#include "redag/base/lock_guard.hpp"
#include "redag/base/pi_mutex.hpp"
#include "redag/base/result.hpp"
#include "redag/runtime/engine.hpp"
#include "redag/runtime/parker.hpp"
#include "timer_queue.hpp"

namespace redag_rclcpp {

class ReleaseTimer {
 public:
  /// `origin`: zero of the engine's clock, on CLOCK_MONOTONIC.
  ReleaseTimer(redag::runtime::Engine &engine, Time origin) : engine_(engine), origin_(origin) {}

  [[nodiscard]] TimerQueue &queue() { return queue_; }
  [[nodiscard]] const TimerQueue &queue() const { return queue_; }

  /// Starts the thread, once. After an error it may be called again.
  [[nodiscard]] redag::Result<void> start(int priority);
  /// Ends the thread.
  void stop();

  /// Lets the thread release jobs, or leaves that to expire().
  void resume();
  void pause() { running_ = false; }
  [[nodiscard]] bool is_running() const { return running_; }
  /// Tells the thread that the queue's next() has become earlier.
  void changed() { parker_.unpark(); }

  /// Releases what is due. Returns when to call it again; kNever: after a change of the queue.
  Time expire();
  /// The same for an idle thread, while the timer runs. The time returned is on CLOCK_MONOTONIC.
  Time release_due();
  /// Waits until releases that left the queue earlier have been passed on.
  void settle() { const redag::LockGuard guard(expire_lock_); }

 private:
  void run() noexcept;

  redag::runtime::Engine &engine_;
  const Time origin_;
  TimerQueue queue_;
  std::thread thread_;
  redag::runtime::Parker parker_;
  std::atomic<bool> running_{false};
  std::atomic<bool> exit_{false};
  redag::PiMutex expire_lock_;
  std::vector<redag::runtime::Release> due_ REDAG_GUARDED_BY(expire_lock_);
  std::vector<redag::runtime::Release> missed_ REDAG_GUARDED_BY(expire_lock_);
};

}  // namespace redag_rclcpp
