// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// InProgress counts the calls of a kind that are in progress, so that another thread can wait until none is. A call
// takes no lock for it. Others can leave work to a call in progress. The caller's lock serialises begin() and tell(),
// and sees to it that no call begins once wait() has been called. The object outlives end().
#pragma once

#include <atomic>
#include <climits>
#include <cstdint>

#include "redag/base/futex.hpp"

namespace redag::runtime {

class InProgress {
 public:
  void begin() noexcept { word_.fetch_add(1, std::memory_order_relaxed); }

  /// Returns true if tell() has left work to the calls in progress. The caller then does it. It sees what was written
  /// under the caller's lock before tell() if it takes this lock.
  [[nodiscard]] bool end() noexcept {
    std::uint32_t seen = word_.load(std::memory_order_relaxed);
    while (!word_.compare_exchange_strong(seen, (seen - 1) & ~kTold, std::memory_order_release,
                                          std::memory_order_relaxed)) {
    }
    if ((seen & kWaited) != 0 && (seen & kCount) == 1) futex_wake(word_, INT_MAX);
    return (seen & kTold) != 0;
  }

  /// Leaves work to a call in progress. Returns false if there is none.
  [[nodiscard]] bool tell() noexcept {
    std::uint32_t seen = word_.load(std::memory_order_relaxed);
    do {
      if ((seen & kCount) == 0) return false;
    } while (!word_.compare_exchange_strong(seen, seen | kTold, std::memory_order_relaxed, std::memory_order_relaxed));
    return true;
  }

  [[nodiscard]] bool none() const noexcept { return (word_.load(std::memory_order_acquire) & kCount) == 0; }

  /// Waits until no call is in progress, and sees all that they did. Does not lend them the caller's priority.
  void wait() noexcept {
    std::uint32_t seen = word_.load(std::memory_order_acquire);
    while ((seen & kCount) != 0) {
      if ((seen & kWaited) != 0 ||
          word_.compare_exchange_strong(seen, seen | kWaited, std::memory_order_relaxed, std::memory_order_relaxed)) {
        futex_wait(word_, seen | kWaited);
      }
      seen = word_.load(std::memory_order_acquire);
    }
  }

 private:
  static constexpr std::uint32_t kTold = 1U << 31;
  static constexpr std::uint32_t kWaited = 1U << 30;
  static constexpr std::uint32_t kCount = kWaited - 1;

  FutexWord word_{0};
};

}  // namespace redag::runtime
