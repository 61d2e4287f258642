// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Replaces clock_gettime() of a test program, for tests of which clocks are read, and when. Include it in one source
// file of the program. Clocks are real until a thread calls step_clock(): from then on CLOCK_MONOTONIC advances for
// this thread by a fixed step at each reading. How long its jobs take no longer depends on the machine.
#pragma once

#include <dlfcn.h>
#include <pthread.h>
#include <time.h>

#include <atomic>
#include <cstdint>
#include <cstring>

namespace redag::testing {

/// Readings by threads that called step_clock().
struct ClockReadings {
  std::atomic<std::uint64_t> monotonic{0};
  std::atomic<std::uint64_t> processor{0};  // of the thread's processor time: a system call
};
inline ClockReadings clock_readings;
/// Advances CLOCK_MONOTONIC of all threads that called step_clock(), in nanoseconds.
inline std::atomic<std::int64_t> clock_ahead{0};
/// For how long a thread that called step_clock() asks for its processor time, in nanoseconds of its stepped clock.
inline std::atomic<std::int64_t> asking_takes{0};
/// Called when a thread that has not called step_clock() reads the processor time of another.
inline std::atomic<void (*)()> on_foreign_clock{nullptr};

namespace detail {
struct Steps {
  std::int64_t step = 0;  // 0: real time
  std::int64_t now = 0;
};
inline constinit thread_local Steps steps;

inline int real_clock(clockid_t clock, timespec *now) noexcept {
  static auto *const real = [] {
    void *const found = dlsym(RTLD_NEXT, "clock_gettime");
    int (*function)(clockid_t, timespec *) = nullptr;
    std::memcpy(&function, &found, sizeof function);
    return function;
  }();
  return real(clock, now);
}
}  // namespace detail

inline void step_clock(std::int64_t step = 100) noexcept {
  if (detail::steps.step != 0) return;
  timespec now{};
  detail::real_clock(CLOCK_MONOTONIC, &now);
  detail::steps = {step, std::int64_t{now.tv_sec} * 1'000'000'000 + now.tv_nsec - clock_ahead};
}

}  // namespace redag::testing

extern "C" int clock_gettime(clockid_t clock, timespec *now) noexcept {
  using namespace redag::testing;
  if (detail::steps.step == 0) {
    if (auto *const call = on_foreign_clock.load(); call != nullptr && clock < 0) call();
    return detail::real_clock(clock, now);
  }
  if (clock == CLOCK_THREAD_CPUTIME_ID) {
    clock_readings.processor.fetch_add(1);
    detail::steps.now += asking_takes;
  }
  if (clock != CLOCK_MONOTONIC) return detail::real_clock(clock, now);
  clock_readings.monotonic.fetch_add(1);
  const std::int64_t at = (detail::steps.now += detail::steps.step) + clock_ahead.load();
  now->tv_sec = at / 1'000'000'000;
  now->tv_nsec = at % 1'000'000'000;
  return 0;
}
