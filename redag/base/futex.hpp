// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The futex operations that this project uses (man 2 futex), for words that are private to the process. Waits can wake
// spuriously; callers loop. Any thread; futex_wake is async-signal-safe.
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

/// Sleeps until the calling thread owns the lock `word`. It is 0 while the lock is free, and else the owner's thread
/// id, with FUTEX_WAITERS while others wait. They lend the owner their priority. Returns false if the kernel refuses.
[[nodiscard]] inline bool futex_lock_pi(FutexWord &word) noexcept {
  for (;;) {
    if (syscall(SYS_futex, &word, FUTEX_LOCK_PI_PRIVATE, 0, nullptr, nullptr, 0) == 0) return true;
    if (errno != EINTR && errno != EAGAIN) return false;
  }
}

/// Gives the lock to the most urgent thread that waits for it, or frees it. Returns false if the kernel refuses: the
/// calling thread does not own the lock.
[[nodiscard]] inline bool futex_unlock_pi(FutexWord &word) noexcept {
  for (;;) {
    if (syscall(SYS_futex, &word, FUTEX_UNLOCK_PI_PRIVATE, 0, nullptr, nullptr, 0) == 0) return true;
    if (errno != EINTR && errno != EAGAIN) return false;
  }
}

}  // namespace redag
