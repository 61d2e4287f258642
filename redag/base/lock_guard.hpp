// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// A std::lock_guard for clang's -Wthread-safety, because libstdc++'s has no annotations.
#pragma once

#include "redag/base/thread_annotations.hpp"

namespace redag {

template <class M>
class REDAG_SCOPED_CAPABILITY LockGuard {
 public:
  explicit LockGuard(M &mutex) REDAG_ACQUIRE(mutex) : mutex_(mutex) { mutex_.lock(); }
  ~LockGuard() REDAG_RELEASE() { mutex_.unlock(); }
  LockGuard(const LockGuard &) = delete;
  LockGuard &operator=(const LockGuard &) = delete;

 private:
  M &mutex_;
};

}  // namespace redag
