// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Notes keeps what threads of the executor tell its users: warnings, deadlocks, and the first exception of a callback.
// Any thread may call it; its lock is the innermost.
#pragma once

#include <algorithm>
#include <exception>
#include <string>
#include <utility>
#include <vector>

#include "redag/base/lock_guard.hpp"
#include "redag/base/pi_mutex.hpp"
#include "redag/base/time.hpp"
#include "redag_rclcpp/executor.hpp"

namespace redag_rclcpp {

class Notes {
 public:
  /// Adds a warning. False: there is the same already.
  bool warn(std::string warning) {
    const redag::LockGuard guard(lock_);
    if (std::find(warnings_.begin(), warnings_.end(), warning) != warnings_.end()) return false;
    warnings_.push_back(std::move(warning));
    return true;
  }
  [[nodiscard]] std::vector<std::string> warnings() const {
    const redag::LockGuard guard(lock_);
    return warnings_;
  }

  /// Keeps the last 100 deadlocks. One that has ended replaces the one that began at the same time with that text.
  void add(const Deadlock &deadlock) {
    constexpr std::size_t kMost = 100;
    const redag::LockGuard guard(lock_);
    const auto same = std::find_if(deadlocks_.begin(), deadlocks_.end(), [&](const Deadlock &other) {
      return other.begun == deadlock.begun && other.text == deadlock.text;
    });
    if (same != deadlocks_.end()) {
      *same = deadlock;
      return;
    }
    if (deadlocks_.size() == kMost) deadlocks_.erase(deadlocks_.begin());
    deadlocks_.push_back(deadlock);
  }
  [[nodiscard]] std::vector<Deadlock> deadlocks() const {
    const redag::LockGuard guard(lock_);
    return deadlocks_;
  }

  /// Keeps the first exception until throw_failure().
  void fail(std::exception_ptr exception) {
    const redag::LockGuard guard(lock_);
    if (!failure_) failure_ = std::move(exception);
  }
  void throw_failure() {
    std::exception_ptr failure;
    {
      const redag::LockGuard guard(lock_);
      failure = std::exchange(failure_, nullptr);
    }
    if (failure) std::rethrow_exception(failure);
  }

 private:
  mutable redag::PiMutex lock_;
  std::vector<std::string> warnings_ REDAG_GUARDED_BY(lock_);
  std::vector<Deadlock> deadlocks_ REDAG_GUARDED_BY(lock_);
  std::exception_ptr failure_ REDAG_GUARDED_BY(lock_);
};

}  // namespace redag_rclcpp
