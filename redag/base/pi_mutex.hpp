// A mutex whose owner inherits the priority of the most urgent thread that waits for it (PTHREAD_PRIO_INHERIT): a
// preempted low-priority owner delays a high-priority waiter by its critical section only. BasicLockable and Lockable,
// for LockGuard, std::lock_guard and std::unique_lock. Use it for data that callbacks of different rates share.
#pragma once

#include <pthread.h>

#include <thread>

#include "redag/base/check.hpp"
#include "redag/base/thread_annotations.hpp"

namespace redag {

class REDAG_CAPABILITY("mutex") PiMutex {
 public:
  /// `inherits` false: for when all threads that take it are alike. It then goes to whoever comes first instead of to
  /// the one that waits, which is faster by far with more threads than processors.
  explicit PiMutex(bool inherits = true) {
    pthread_mutexattr_t attributes;
    REDAG_CHECK(pthread_mutexattr_init(&attributes) == 0, "no mutex attributes");
    const int protocol = inherits ? PTHREAD_PRIO_INHERIT : PTHREAD_PRIO_NONE;
    REDAG_CHECK(pthread_mutexattr_setprotocol(&attributes, protocol) == 0, "no priority inheritance");
    REDAG_CHECK(pthread_mutex_init(&mutex_, &attributes) == 0, "the kernel has no priority-inheriting futexes");
    pthread_mutexattr_destroy(&attributes);
  }
  ~PiMutex() { pthread_mutex_destroy(&mutex_); }

  PiMutex(const PiMutex &) = delete;
  PiMutex &operator=(const PiMutex &) = delete;

  /// Tries for about as long as a short critical section takes on another processor, and then sleeps. A mutex that
  /// inherits priority is handed to the first who sleeps: once one does, whoever comes before it has woken up sleeps
  /// too.
  void lock() noexcept REDAG_ACQUIRE() {
    static const int kTries = std::thread::hardware_concurrency() > 1 ? kSpins : 0;
    for (int i = 0; i < kTries; ++i) {
      if (pthread_mutex_trylock(&mutex_) == 0) return;
      relax();
    }
    REDAG_CHECK(pthread_mutex_lock(&mutex_) == 0, "a mutex cannot be locked");
  }
  [[nodiscard]] bool try_lock() noexcept REDAG_TRY_ACQUIRE(true) { return pthread_mutex_trylock(&mutex_) == 0; }
  void unlock() noexcept REDAG_RELEASE() {
    REDAG_CHECK(pthread_mutex_unlock(&mutex_) == 0, "a mutex is unlocked by who does not own it");
  }

 private:
  static constexpr int kSpins = 80;  // about 2 us

  static void relax() noexcept {
#if defined(__x86_64__) || defined(__i386__)
    __builtin_ia32_pause();
#elif defined(__aarch64__)
    __asm__ __volatile__("yield");
#endif
  }

  pthread_mutex_t mutex_;
};

}  // namespace redag
