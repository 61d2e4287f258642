// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// When which timer expires next: a heap of due times, without a thread. The expiry itself is the timer's affair: the
// queue asks it (Timer::expire). Any thread; allocates only while it grows.
#pragma once

#include <vector>

#include "redag/base/lock_guard.hpp"
#include "redag/base/pi_mutex.hpp"
#include "redag/runtime/engine.hpp"

namespace redag_rclcpp {

using redag::Duration;
using redag::TaskId;
using redag::Time;

class TimerQueue {
 public:
  static constexpr std::size_t kNowhere = ~std::size_t{0};
  /// Two readings of a timer differ by a little: due times closer than this are the same one.
  static constexpr Duration kSame = 2 * redag::kMicrosecond;

  /// What waits in the queue. Outlives its stay there.
  class Timer {
   public:
    /// Its time has come. Appends the release if it has really expired, and the releases it missed on the way; returns
    /// when to ask again (kNever: when it says so, by schedule()). Under the queue's lock.
    virtual Time expire(Time now, std::vector<redag::runtime::Release> &releases,
                        std::vector<redag::runtime::Release> &missed) = 0;

    virtual ~Timer() = default;

   private:
    friend class TimerQueue;
    Time due_ = redag::kNever;
    std::size_t position_ = kNowhere;  // in the heap
  };

  /// Replaces what was scheduled for `timer` before; kNever: nothing. True if the queue now has an earlier next().
  bool schedule(Timer &timer, Time due);

  /// When the next timer is due; kNever: none.
  [[nodiscard]] Time next() const;

  /// Asks all timers that are due. Returns when the next one is.
  Time expire_due(Time now, std::vector<redag::runtime::Release> &releases,
                  std::vector<redag::runtime::Release> &missed);

 private:
  void place(Timer &timer, Time due) REDAG_REQUIRES(lock_);
  void sift(std::size_t position) REDAG_REQUIRES(lock_);
  void set(std::size_t position, Timer *timer) REDAG_REQUIRES(lock_);

  mutable redag::PiMutex lock_;
  std::vector<Timer *> heap_ REDAG_GUARDED_BY(lock_);  // binary, by due_
};

}  // namespace redag_rclcpp
