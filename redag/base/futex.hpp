// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The three futex operations that this project uses (man 2 futex), for words that are private to the process. All waits
// can wake spuriously; callers loop. Any thread; futex_wake is async-signal-safe.
#pragma once

#include <linux/futex.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <cerrno>
#include <cstdint>
#include <ctime>

#include "redag/base/atomic.hpp"
#include "redag/base/time.hpp"

namespace redag {

using FutexWord = Atomic<std::uint32_t>;
static_assert(sizeof(FutexWord) == sizeof(std::uint32_t) && FutexWord::is_always_lock_free);

/// Sleeps while `word` holds `expected`.
inline void futex_wait(FutexWord &word, std::uint32_t expected) noexcept {
  syscall(SYS_futex, &word, FUTEX_WAIT_PRIVATE, expected, nullptr, nullptr, 0);
}

/// Sleeps while `word` holds `expected`, at most until `deadline` on CLOCK_MONOTONIC. Returns false if it timed out.
inline bool futex_wait_until(FutexWord &word, std::uint32_t expected, Time deadline) noexcept {
  if (deadline < 0) return false;
  timespec until{};
  until.tv_sec = static_cast<std::time_t>(deadline / kSecond);
  until.tv_nsec = static_cast<long>(deadline % kSecond);
  // FUTEX_WAIT takes a relative timeout, the BITSET form an absolute one on CLOCK_MONOTONIC.
  const long result =
      syscall(SYS_futex, &word, FUTEX_WAIT_BITSET_PRIVATE, expected, &until, nullptr, FUTEX_BITSET_MATCH_ANY);
  return !(result == -1 && errno == ETIMEDOUT);
}

/// Wakes up to `count` threads that sleep on `word`, the most urgent real-time threads first.
inline void futex_wake(FutexWord &word, int count) noexcept {
  syscall(SYS_futex, &word, FUTEX_WAKE_PRIVATE, count, nullptr, nullptr, 0);
}

}  // namespace redag
