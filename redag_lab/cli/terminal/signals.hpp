// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Handles Ctrl-C: the first SIGINT or SIGTERM sets a flag that the running command polls, and the second one ends the
// process at once. One guard at a time.
#pragma once

#include <atomic>
#include <csignal>

namespace redag::cli {

class InterruptGuard {
 public:
  /// Installs the handlers. The destructor restores the previous ones, unless there was a signal.
  InterruptGuard();
  ~InterruptGuard();
  InterruptGuard(const InterruptGuard &) = delete;
  InterruptGuard &operator=(const InterruptGuard &) = delete;

  /// Set by the first signal. Lock-free; any thread may read it.
  [[nodiscard]] static const std::atomic<bool> &flag();
  [[nodiscard]] static bool interrupted() { return flag().load(std::memory_order_relaxed); }

 private:
  struct sigaction old_interrupt_ {};
  struct sigaction old_terminate_ {};
};

}  // namespace redag::cli
