// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// A mutex whose owner inherits the priority of the most urgent thread that waits for it (PTHREAD_PRIO_INHERIT): a
// preempted low-priority owner delays a high-priority waiter by short critical sections only. BasicLockable and
// Lockable, for LockGuard, std::lock_guard and std::unique_lock. Use it for data that callbacks of different rates
// share. It may be destroyed once every unlock() has returned.
#pragma once

#include <pthread.h>

#include <thread>

#include "redag/base/check.hpp"
#include "redag/base/relax.hpp"
#include "redag/base/thread_annotations.hpp"

namespace redag {

// The kernel hands such a mutex to the first that sleeps for it. Until that one has woken up nobody else gets it and
// all who come go to sleep, too: a mutex held for 100 ns then costs 10 us each time, for ever. So whoever finds it
// taken tries for a short while, and of those for whom this was not enough only one at a time sleeps for the mutex; the
// others sleep for `queue_`, which inherits, too. When the one has been served, the next is woken while the mutex is
// free: others can have it meanwhile, but only until it is awake and asks for it. So a thread waits for the owner, for
// the one ahead of it in the queue, who then runs at its priority, and for more urgent ones. On cache lines of its own:
// whoever tries does not slow down what the owner does to the data beside it.
class alignas(64) REDAG_CAPABILITY("mutex") PiMutex {
 public:
  /// `inherits` false: for when all threads that take it are alike.
  explicit PiMutex(bool inherits = true) : inherits_(inherits) {
    initialize(mutex_, inherits);
    initialize(queue_, inherits);
  }
  ~PiMutex() {
    pthread_mutex_destroy(&queue_);
    pthread_mutex_destroy(&mutex_);
  }

  PiMutex(const PiMutex &) = delete;
  PiMutex &operator=(const PiMutex &) = delete;

  void lock() noexcept REDAG_ACQUIRE() {
    if (spin()) return;
    if (!inherits_) return acquire(mutex_);
    acquire(queue_);
    if (!spin()) acquire(mutex_);
    queued_ = true;
  }
  [[nodiscard]] bool try_lock() noexcept REDAG_TRY_ACQUIRE(true) { return pthread_mutex_trylock(&mutex_) == 0; }
  void unlock() noexcept REDAG_RELEASE() {
    const bool queued = queued_;
    queued_ = false;
    release(mutex_);
    if (queued) release(queue_);
  }

 private:
  // The longest pause between two tries; all of them together take less than 2 us.
  static constexpr int kPauses = 32;

  static void initialize(pthread_mutex_t &mutex, bool inherits) {
    pthread_mutexattr_t attributes;
    REDAG_CHECK(pthread_mutexattr_init(&attributes) == 0, "no mutex attributes");
    const int protocol = inherits ? PTHREAD_PRIO_INHERIT : PTHREAD_PRIO_NONE;
    REDAG_CHECK(pthread_mutexattr_setprotocol(&attributes, protocol) == 0, "no priority inheritance");
    REDAG_CHECK(pthread_mutex_init(&mutex, &attributes) == 0, "the kernel has no priority-inheriting futexes");
    pthread_mutexattr_destroy(&attributes);
  }

  static void acquire(pthread_mutex_t &mutex) noexcept {
    REDAG_CHECK(pthread_mutex_lock(&mutex) == 0, "a mutex cannot be locked");
  }
  static void release(pthread_mutex_t &mutex) noexcept {
    REDAG_CHECK(pthread_mutex_unlock(&mutex) == 0, "a mutex is unlocked by who does not own it");
  }

  /// Tries for longer than a short critical section on another processor takes, less and less often.
  bool spin() noexcept {
    static const int kLongest = std::thread::hardware_concurrency() > 1 ? kPauses : 0;
    for (int pauses = 1;; pauses *= 2) {
      if (pthread_mutex_trylock(&mutex_) == 0) return true;
      if (pauses > kLongest) return false;
      for (int i = 0; i < pauses; ++i) relax();
    }
  }

  pthread_mutex_t mutex_;
  pthread_mutex_t queue_;  // who owns it is the only one that sleeps for `mutex_`
  const bool inherits_;
  bool queued_ = false;  // the owner of `mutex_` owns `queue_`, too
};

}  // namespace redag
