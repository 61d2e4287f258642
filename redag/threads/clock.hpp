// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The clocks of the threaded runtime, in nanoseconds. Any thread; async-signal-safe.
#pragma once

#include <ctime>

#include "redag/base/time.hpp"

namespace redag::runtime {

namespace detail {
inline Time read_clock(clockid_t clock) noexcept {
  timespec now{};
  clock_gettime(clock, &now);
  return static_cast<Time>(now.tv_sec) * kSecond + now.tv_nsec;
}
}  // namespace detail

/// CLOCK_MONOTONIC: never set back, the same on every processor.
[[nodiscard]] inline Time monotonic_now() noexcept { return detail::read_clock(CLOCK_MONOTONIC); }

/// Processor time of the calling thread, which stands still while the thread sleeps or is preempted. A system call.
[[nodiscard]] inline Duration thread_cpu_now() noexcept { return detail::read_clock(CLOCK_THREAD_CPUTIME_ID); }

/// Processor time of any thread, by its clock (cpu_clock_of() in redag/threads/threads.hpp). Undefined once that thread
/// has ended.
[[nodiscard]] inline Duration cpu_now(clockid_t clock) noexcept { return detail::read_clock(clock); }

}  // namespace redag::runtime
