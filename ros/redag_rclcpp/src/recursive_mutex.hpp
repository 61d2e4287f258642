// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// RecursiveMutex is a recursive mutex whose owner inherits the priority of waiting threads. std::recursive_mutex does
// not inherit. clang's -Wthread-safety understands the class.
#pragma once

#include <pthread.h>

#include "redag/base/check.hpp"
#include "redag/base/thread_annotations.hpp"

namespace redag_rclcpp {

class REDAG_CAPABILITY("mutex") RecursiveMutex {
 public:
  RecursiveMutex() {
    pthread_mutexattr_t attributes;
    REDAG_CHECK(pthread_mutexattr_init(&attributes) == 0, "no mutex attributes");
    REDAG_CHECK(pthread_mutexattr_settype(&attributes, PTHREAD_MUTEX_RECURSIVE) == 0, "no recursive mutexes");
    REDAG_CHECK(pthread_mutexattr_setprotocol(&attributes, PTHREAD_PRIO_INHERIT) == 0, "no priority inheritance");
    REDAG_CHECK(pthread_mutex_init(&mutex_, &attributes) == 0, "the kernel has no priority-inheriting futexes");
    pthread_mutexattr_destroy(&attributes);
  }
  ~RecursiveMutex() { pthread_mutex_destroy(&mutex_); }
  RecursiveMutex(const RecursiveMutex &) = delete;
  RecursiveMutex &operator=(const RecursiveMutex &) = delete;

  void lock() REDAG_ACQUIRE() { REDAG_CHECK(pthread_mutex_lock(&mutex_) == 0, "a mutex cannot be locked"); }
  void unlock() REDAG_RELEASE() {
    REDAG_CHECK(pthread_mutex_unlock(&mutex_) == 0, "a mutex is unlocked by a thread that does not own it");
  }
  /// Tells the analysis that the caller holds the mutex, where it cannot see the caller.
  void assert_held() const REDAG_ASSERT_CAPABILITY(this) {}

 private:
  pthread_mutex_t mutex_{};
};

}  // namespace redag_rclcpp
