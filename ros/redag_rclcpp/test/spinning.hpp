// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Helpers for tests that spin an executor on a thread of its own, and for callbacks that take time.
#pragma once

#include <sys/syscall.h>
#include <unistd.h>

#include <atomic>
#include <chrono>
#include <thread>

#include "redag/threads/clock.hpp"

namespace redag_rclcpp {

/// Longest wait of a test for an expected event; far longer than any event takes.
inline constexpr std::chrono::seconds kLimit{60};

/// Repeats `meanwhile` until `condition` holds. False: the limit was reached.
template <class Condition, class Meanwhile>
bool eventually(Condition condition, Meanwhile meanwhile) {
  const auto end = std::chrono::steady_clock::now() + kLimit;
  while (!condition()) {
    if (std::chrono::steady_clock::now() > end) return false;
    meanwhile();
  }
  return true;
}

template <class Condition>
bool eventually(Condition condition) {
  return eventually(condition, [] { std::this_thread::sleep_for(std::chrono::milliseconds(1)); });
}

/// Uses `amount` of this thread's processor time.
inline void use_processor(std::chrono::nanoseconds amount) {
  const redag::Time end = redag::runtime::thread_cpu_now() + amount.count();
  while (redag::runtime::thread_cpu_now() < end) {
  }
}

/// Spins an executor on a thread of its own until destruction.
template <class Executor>
class Spinner {
 public:
  explicit Spinner(Executor &executor)
      : executor_(executor), thread_([&] {
          thread_id_ = static_cast<int>(syscall(SYS_gettid));
          executor.spin();
        }) {
    eventually([&] { return executor.is_spinning(); });
  }
  ~Spinner() { stop(); }
  Spinner(const Spinner &) = delete;
  Spinner &operator=(const Spinner &) = delete;

  void stop() {
    executor_.cancel();
    if (thread_.joinable()) thread_.join();
  }
  [[nodiscard]] int thread_id() const { return thread_id_; }

 private:
  Executor &executor_;
  std::atomic<int> thread_id_{0};
  std::thread thread_;
};

}  // namespace redag_rclcpp
