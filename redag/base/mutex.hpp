// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// A std::mutex for clang's -Wthread-safety, for threads whose priorities do not matter. Otherwise use PiMutex.
#pragma once

#include <mutex>

#include "redag/base/thread_annotations.hpp"

namespace redag {

class REDAG_CAPABILITY("mutex") Mutex {
 public:
  void lock() REDAG_ACQUIRE() { mutex_.lock(); }
  [[nodiscard]] bool try_lock() REDAG_TRY_ACQUIRE(true) { return mutex_.try_lock(); }
  void unlock() REDAG_RELEASE() { mutex_.unlock(); }

 private:
  std::mutex mutex_;
};

}  // namespace redag
