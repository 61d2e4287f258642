// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Replaces redag/base/futex.hpp: the same operations on the explorer's threads. It knows no priorities, and therefore
// no locks that inherit them.
#pragma once

#include <linux/futex.h>

#include <cstdint>

#include "redag/base/atomic.hpp"
#include "redag/base/time.hpp"

namespace redag {

using FutexWord = Atomic<std::uint32_t>;

inline bool futex_wait_until(FutexWord &word, std::uint32_t expected, Time deadline) noexcept {
  if (deadline < 0) return false;
  return testing::explored::wait(
      word.id(), [&] { return word.peek() == expected; }, deadline);
}
inline void futex_wait(FutexWord &word, std::uint32_t expected) noexcept {
  static_cast<void>(futex_wait_until(word, expected, kNever));
}
inline void futex_wake(FutexWord &word, int count) noexcept { testing::explored::wake(word.id(), count); }
[[nodiscard]] inline bool futex_lock_pi(FutexWord &) noexcept { return false; }
[[nodiscard]] inline bool futex_unlock_pi(FutexWord &) noexcept { return false; }

}  // namespace redag
