// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// A std::mutex for clang's -Wthread-safety, for threads whose priorities do not matter, and for unbounded work.
// Otherwise use PiMutex.
#pragma once

#include <mutex>

#include "redag/base/lock_class.hpp"
#include "redag/base/thread_annotations.hpp"

namespace redag {

class REDAG_CAPABILITY("mutex") Mutex {
 public:
  void lock() REDAG_ACQUIRE() {
    detail::before_lock(LockClass::Unbounded);
    mutex_.lock();
  }
  [[nodiscard]] bool try_lock() REDAG_TRY_ACQUIRE(true) { return mutex_.try_lock(); }
  void unlock() REDAG_RELEASE() { mutex_.unlock(); }

 private:
  std::mutex mutex_;
};

}  // namespace redag
