// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Replaces redag/base/pi_mutex.hpp by a mutex of the explorer. It knows no priorities: every order is tried.
#pragma once

#include "redag/base/lock_class.hpp"
#include "redag/base/thread_annotations.hpp"
#include "tests/testing/explorer.hpp"

namespace redag {

class REDAG_CAPABILITY("mutex") PiMutex {
 public:
  explicit PiMutex(bool = true, LockClass = LockClass::Undeclared) {}
  explicit PiMutex(LockClass) {}
  PiMutex(const PiMutex &) = delete;
  PiMutex &operator=(const PiMutex &) = delete;

  /// The explorer does not tell whether the mutex was free, and unlock() not whether it woke a thread.
  bool lock() noexcept REDAG_ACQUIRE() {
    testing::explored::lock(id_);
    return true;
  }
  bool unlock() noexcept REDAG_RELEASE() {
    testing::explored::unlock(id_);
    return false;
  }

 private:
  testing::ObjectId id_ = testing::explored::new_object();
};

}  // namespace redag
