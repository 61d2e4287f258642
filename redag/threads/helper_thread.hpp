// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// A thread beside the workers, which sleeps on its parker between its looks. Its main function returns once ending().
#pragma once

#include <atomic>
#include <functional>
#include <utility>

#include "redag/base/atomic.hpp"
#include "redag/base/result.hpp"
#include "redag/threads/parker.hpp"
#include "redag/threads/threads.hpp"

namespace redag::runtime {

class HelperThread {
 public:
  /// Error: what the system refused. It can be called again after an error, and after end().
  [[nodiscard]] Result<void> start(const ThreadSetup &setup, std::function<void()> main) {
    ending_.store(false, std::memory_order_relaxed);
    Result<ThreadHandle> started = start_thread(setup, std::move(main));
    if (!started) return tl::unexpected(started.error());
    handle_ = *std::move(started);
    return {};
  }
  /// Waits for the thread, if there is one.
  void end() {
    if (!handle_.joinable()) return;
    ending_.store(true, std::memory_order_release);
    parker.unpark();
    handle_.join();
  }
  [[nodiscard]] bool ending() const { return ending_.load(std::memory_order_acquire); }

  Parker parker;

 private:
  Atomic<bool> ending_{false};
  ThreadHandle handle_;
};

}  // namespace redag::runtime
