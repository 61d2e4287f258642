// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// TimerQueue is a heap of due times that tells which timer expires next. It has no thread. When a due time has passed,
// it calls Timer::expire(). Any thread may call it; it allocates only while it grows.
#pragma once

#include <vector>

#include "redag/base/lock_guard.hpp"
#include "redag/base/pi_mutex.hpp"
#include "redag/engine/engine.hpp"

namespace redag_rclcpp {

using redag::Duration;
using redag::TaskId;
using redag::Time;

class TimerQueue {
 public:
  static constexpr std::size_t kNowhere = ~std::size_t{0};
  /// Two readings of a timer differ slightly: due times closer than this count as the same.
  static constexpr Duration kSame = 2 * redag::kMicrosecond;

  /// An entry of the queue. Must outlive its time in the queue.
  class Timer {
   public:
    /// Called when the due time has passed, with the queue's lock held. Appends the release if the timer has really
    /// expired, and the releases that were missed before it. Returns when to call it again; kNever: after the next
    /// schedule().
    virtual Time expire(Time now, std::vector<redag::runtime::Release> &releases,
                        std::vector<redag::runtime::Release> &missed) = 0;

    virtual ~Timer() = default;

   private:
    friend class TimerQueue;
    Time due_ = redag::kNever;
    std::size_t position_ = kNowhere;  // position in the heap
  };

  /// Replaces the timer's due time; kNever: removes the timer. True if next() has become earlier.
  bool schedule(Timer &timer, Time due);

  /// Due time of the next timer; kNever: none.
  [[nodiscard]] Time next() const;

  /// Calls expire() of all timers that are due. Returns the due time of the next one.
  Time expire_due(Time now, std::vector<redag::runtime::Release> &releases,
                  std::vector<redag::runtime::Release> &missed);

 private:
  void place(Timer &timer, Time due) REDAG_REQUIRES(lock_);
  void sift(std::size_t position) REDAG_REQUIRES(lock_);
  void set(std::size_t position, Timer *timer) REDAG_REQUIRES(lock_);

  mutable redag::PiMutex lock_;
  std::vector<Timer *> heap_ REDAG_GUARDED_BY(lock_);  // binary heap, ordered by due_
};

}  // namespace redag_rclcpp
