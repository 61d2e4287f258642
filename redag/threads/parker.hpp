// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Two ways for a thread to sleep on a futex word. Parker: one owner parks and any thread unparks; an early token is not
// lost. Event: set once, for any number of waiters. unpark() and set() are async-signal-safe.
#pragma once

#include <atomic>
#include <climits>
#include <cstdint>

#include "redag/base/futex.hpp"
#include "redag/base/relax.hpp"
#include "redag/base/time.hpp"

namespace redag::runtime {

class Parker {
 public:
  /// Owner only: takes a token. Spins up to `spins` times for it, then sleeps. A token that comes during the spin needs
  /// no system call.
  void park(std::uint32_t spins = 0) noexcept {
    static_cast<void>(spin(spins));
    if (begin()) return;
    do {
      futex_wait(state_, kParked);
    } while (!take());
  }

  /// Owner only: as park(), at most until `deadline` (CLOCK_MONOTONIC). Returns true if it took a token.
  bool park_until(Time deadline) noexcept {
    if (begin()) return true;
    while (futex_wait_until(state_, kParked, deadline)) {
      if (take()) return true;
    }
    return state_.exchange(kEmpty, std::memory_order_acquire) == kToken;
  }

  /// Owner only: spins up to `spins` times, with a pause after each, until there is a token. Leaves the token there.
  /// Returns true if there is one.
  [[nodiscard]] bool spin(std::uint32_t spins) const noexcept {
    for (; spins > 0; --spins) {
      if (state_.load(std::memory_order_relaxed) == kToken) return true;
      relax();
    }
    return false;
  }

  /// Leaves a token. Several tokens count as one.
  void unpark() noexcept {
    if (state_.exchange(kToken, std::memory_order_release) == kParked) futex_wake(state_, 1);
  }

 private:
  // Empty -> Parked -> Token -> Empty;  Empty -> Token -> Empty;  Parked -> Empty (timed out).
  static constexpr std::uint32_t kParked = 0;
  static constexpr std::uint32_t kEmpty = 1;
  static constexpr std::uint32_t kToken = 2;

  // Empty -> Parked, or Token -> Empty (true): one step down either way.
  bool begin() noexcept { return state_.fetch_sub(1, std::memory_order_acquire) == kToken; }

  bool take() noexcept {
    std::uint32_t expected = kToken;
    return state_.compare_exchange_strong(expected, kEmpty, std::memory_order_acquire, std::memory_order_relaxed);
  }

  FutexWord state_{kEmpty};
};

class Event {
 public:
  void set() noexcept {
    if (word_.exchange(1, std::memory_order_release) == 0) futex_wake(word_, INT_MAX);
  }

  [[nodiscard]] bool is_set() const noexcept { return word_.load(std::memory_order_acquire) != 0; }

  void wait() noexcept {
    while (!is_set()) futex_wait(word_, 0);
  }

  /// Waits until set, at most until `deadline` (CLOCK_MONOTONIC). Returns true if it was set.
  bool wait_until(Time deadline) noexcept {
    while (!is_set()) {
      if (!futex_wait_until(word_, 0, deadline)) return is_set();
    }
    return true;
  }

 private:
  FutexWord word_{0};
};

}  // namespace redag::runtime
