// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "virtual_time.hpp"

#include <sys/syscall.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <cstdint>
#include <ctime>

namespace {

constexpr std::int64_t kStep = 100;  // ns; a job of the engine reads two clocks
constexpr std::int64_t kNanosecondsPerSecond = 1'000'000'000;
constexpr clockid_t kClocks = CLOCK_BOOTTIME + 1;

std::atomic<bool> everywhere{false};
thread_local bool here = false;
std::atomic<std::int64_t> readings{0};
std::array<std::atomic<std::int64_t>, kClocks> origins;

int read_real(clockid_t clock, timespec *time) { return static_cast<int>(syscall(SYS_clock_gettime, clock, time)); }

void set_origins() {
  for (clockid_t clock = 0; clock < kClocks; ++clock) {
    timespec time{};
    read_real(clock, &time);
    origins[static_cast<std::size_t>(clock)] = time.tv_sec * kNanosecondsPerSecond + time.tv_nsec - readings * kStep;
  }
}

}  // namespace

// Takes the place of the C library's function, for shared libraries as well.
extern "C" int clock_gettime(clockid_t clock, timespec *time) noexcept {
  if (!(here || everywhere.load(std::memory_order_relaxed)) || clock < 0 || clock >= kClocks) {
    return read_real(clock, time);
  }
  const std::int64_t now = origins[static_cast<std::size_t>(clock)].load(std::memory_order_relaxed) +
                           (readings.fetch_add(1, std::memory_order_relaxed) + 1) * kStep;
  time->tv_sec = now / kNanosecondsPerSecond;
  time->tv_nsec = now % kNanosecondsPerSecond;
  return 0;
}

namespace redag::benchmarks {

void begin_virtual_time() {
  set_origins();
  everywhere = true;
}

void begin_virtual_time_here() {
  set_origins();
  here = true;
}

void end_virtual_time_here() { here = false; }

}  // namespace redag::benchmarks
