// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Replaces redag/threads/threads.hpp by the explorer's threads. They grant every request; only starting
// thread_that_fails is refused.
#pragma once

#include <cstddef>
#include <cstdint>
#include <ctime>
#include <functional>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "redag/base/result.hpp"
#include "tests/testing/explorer.hpp"

namespace redag::runtime {

class ThreadHandle {
 public:
  ThreadHandle() = default;
  explicit ThreadHandle(std::uint32_t thread) : thread_(thread) {}
  ThreadHandle(ThreadHandle &&other) noexcept : thread_(std::exchange(other.thread_, std::nullopt)) {}
  ThreadHandle &operator=(ThreadHandle &&other) noexcept {
    testing::explored::check(!thread_, "a thread is forgotten that was not joined");
    thread_ = std::exchange(other.thread_, std::nullopt);
    return *this;
  }
  ~ThreadHandle() { testing::explored::check(!thread_, "a thread is destroyed that was not joined"); }

  [[nodiscard]] bool joinable() const noexcept { return thread_.has_value(); }
  void join() {
    testing::explored::check(joinable(), "a thread is joined twice");
    testing::explored::join(*thread_);
    thread_.reset();
  }
  [[nodiscard]] std::uint32_t native_handle() const noexcept { return thread_.value_or(0); }

 private:
  std::optional<std::uint32_t> thread_;
};

using ProcessorWord = const volatile std::uint32_t *;

struct ThreadSetup {
  std::string name;
  int fifo_priority = 0;
  std::vector<int> cpus;
  std::size_t touched_stack = 0;
  ProcessorWord *processor = nullptr;
};

inline constexpr std::size_t kTouchedStack = 0;

inline std::optional<std::string> thread_that_fails;  // name of the thread that cannot be started

[[nodiscard]] inline Result<ThreadHandle> start_thread(const ThreadSetup &setup, std::function<void()> main) {
  if (thread_that_fails == setup.name) return make_error("thread '" + setup.name + "' cannot be created");
  return ThreadHandle(testing::explored::spawn(std::move(main)));
}

struct BeforeOrdinaryThreads {
  explicit BeforeOrdinaryThreads(bool) {}
};

class ThreadStart {
 public:
  ThreadStart(const ThreadSetup &setup, std::function<void()> main) : started_(start_thread(setup, std::move(main))) {}

  [[nodiscard]] bool created() const { return started_.has_value(); }
  [[nodiscard]] Result<ThreadHandle> finish() { return std::move(started_); }

 private:
  Result<ThreadHandle> started_;
};

[[nodiscard]] inline clockid_t cpu_clock_of(ThreadHandle &) noexcept { return 0; }
[[nodiscard]] inline int processor_of(ProcessorWord) noexcept { return -1; }
[[nodiscard]] inline ProcessorWord this_threads_processor() noexcept { return nullptr; }
inline std::function<void(std::uint32_t thread, int priority)> on_set_priority;
[[nodiscard]] inline bool set_fifo_priority(std::uint32_t thread, int priority) noexcept {
  if (on_set_priority) on_set_priority(thread, priority);
  return true;
}
[[nodiscard]] inline int fifo_priority_above_this_thread() { return 0; }
[[nodiscard]] inline std::vector<int> usable_cpus() { return {0, 1, 2, 3}; }
[[nodiscard]] inline int available_fifo_priority(int wanted) { return wanted; }
[[nodiscard]] inline const char *realtime_hint() { return ""; }
[[nodiscard]] inline Result<void> lock_memory() { return {}; }
struct Throttling {
  std::int64_t runtime_us = 0;
  std::int64_t period_us = 0;
};
[[nodiscard]] inline std::optional<Throttling> realtime_throttling() { return std::nullopt; }

}  // namespace redag::runtime
