// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// A time at which one thread, the owner, wakes up. Other threads can move it without waking the owner, which a futex
// does not offer (man 2 timerfd_create). Owns a file descriptor. set(): any thread. ring(): async-signal-safe.
#pragma once

#include <sys/timerfd.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <cstdint>
#include <ctime>

#include "redag/base/atomic.hpp"
#include "redag/base/time.hpp"

namespace redag {

class Alarm {
 public:
  Alarm() = default;
  ~Alarm() {
    if (timer_ >= 0) ::close(timer_);
  }
  Alarm(const Alarm &) = delete;
  Alarm &operator=(const Alarm &) = delete;

  /// Must succeed before the first wait(). Returns false if the process may open no more files (errno).
  [[nodiscard]] bool open() noexcept {
    if (timer_ < 0) timer_ = ::timerfd_create(CLOCK_MONOTONIC, TFD_CLOEXEC);
    return timer_ >= 0;
  }

  /// Replaces the time (CLOCK_MONOTONIC; kNever: none). Callers agree among themselves whose time is the last.
  void set(Time at) noexcept {
    arm(at);
    if (rung_.load(std::memory_order_seq_cst)) arm(0);
  }
  /// The owner's present or next wait() returns at once, also if set() follows.
  void ring() noexcept {
    rung_.store(true, std::memory_order_seq_cst);
    arm(0);
  }
  /// Owner only: sleeps until the time or a ring. Can return without either. If the program has closed the descriptor,
  /// as some do that become a daemon, it sleeps for a millisecond: late, but without taking the processor.
  void wait() noexcept {
    std::uint64_t expirations = 0;
    if (::read(timer_, &expirations, sizeof expirations) < 0 && errno != EINTR) {
      const timespec nap{0, kMillisecond};
      static_cast<void>(::nanosleep(&nap, nullptr));
    }
    rung_.exchange(false, std::memory_order_seq_cst);
  }

 private:
  void arm(Time at) noexcept {
    itimerspec spec{};
    if (at != kNever) {
      at = at > 0 ? at : 1;  // 0 would disarm the timer
      spec.it_value.tv_sec = static_cast<std::time_t>(at / kSecond);
      spec.it_value.tv_nsec = static_cast<long>(at % kSecond);
    }
    static_cast<void>(::timerfd_settime(timer_, TFD_TIMER_ABSTIME, &spec, nullptr));
  }

  int timer_ = -1;
  Atomic<bool> rung_{false};
};

}  // namespace redag
