// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// A mutex whose owner inherits the priority of the most urgent thread that waits for it (a PI-futex). A preempted
// low-priority owner delays a high-priority waiter by short critical sections only. BasicLockable and Lockable, for
// LockGuard, std::lock_guard and std::unique_lock. Use it for data that callbacks of different rates share. It may be
// destroyed once every unlock() has returned.
#pragma once

#include <thread>

#include "redag/base/futex_lock.hpp"
#include "redag/base/lock_class.hpp"
#include "redag/base/relax.hpp"
#include "redag/base/thread_annotations.hpp"

namespace redag {

// The kernel hands such a mutex to the first thread that sleeps for it. Until that thread has woken up, all later ones
// sleep, too, and a mutex held for 100 ns then costs each of them 10 us. Therefore a thread that finds the mutex taken
// spins for a short while. If that does not suffice, it queues: only the first in the queue sleeps for the mutex, the
// others for `queue_`, which also inherits. After the first has been served, the next one is woken while the mutex is
// free. Until it is awake, other threads can have the mutex. A thread thus waits for the owner, for the one ahead of it
// in the queue (which then runs at its priority), and for more urgent threads. The mutex has cache lines of its own,
// because spinning must not slow down the owner's access to the data beside it.
class alignas(64) REDAG_CAPABILITY("mutex") PiMutex {
 public:
  /// `inherits` can be false if all threads that take the mutex have the same priority.
  explicit PiMutex(bool inherits = true, LockClass its_class = LockClass::Undeclared)
      : mutex_(inherits), inherits_(inherits), class_(its_class), queue_(inherits) {}
  explicit PiMutex(LockClass its_class) : PiMutex(true, its_class) {}

  PiMutex(const PiMutex &) = delete;
  PiMutex &operator=(const PiMutex &) = delete;

  /// Returns true if the mutex was free.
  bool lock() noexcept REDAG_ACQUIRE() {
    detail::before_lock(class_);
    const bool was_free = mutex_.try_lock();
    if (!was_free) wait();
    detail::after_lock(class_);
    return was_free;
  }
  [[nodiscard]] bool try_lock() noexcept REDAG_TRY_ACQUIRE(true) {
    const bool was_free = mutex_.try_lock();
    if (was_free) detail::after_lock(class_);
    return was_free;
  }
  /// Returns true if it woke a thread, which is a system call.
  bool unlock() noexcept REDAG_RELEASE() {
    detail::before_unlock(class_);
    const bool queued = queued_;
    queued_ = false;
    const bool woke = mutex_.unlock();
    return (queued && queue_.unlock()) || woke;
  }

 private:
  void wait() noexcept {
    if (spin()) return;
    if (!inherits_) return mutex_.lock();
    queue_.lock();
    if (!spin()) mutex_.lock();
    queued_ = true;
  }

  // The longest pause between two tries, in calls of relax(). All pauses together take less than 2 us.
  static constexpr int kPauses = 32;

  /// Tries for longer than a short critical section takes on another processor, with growing pauses.
  bool spin() noexcept {
    static const int kLongest = std::thread::hardware_concurrency() > 1 ? kPauses : 0;
    for (int pauses = 1;; pauses *= 2) {
      if (mutex_.try_lock()) return true;
      if (pauses > kLongest) return false;
      for (int i = 0; i < pauses; ++i) relax();
    }
  }

  FutexLock mutex_;
  const bool inherits_;
  const LockClass class_;
  bool queued_ = false;  // the owner of `mutex_` also owns `queue_`
  FutexLock queue_;      // its owner is the only thread that sleeps for `mutex_`
};

}  // namespace redag
