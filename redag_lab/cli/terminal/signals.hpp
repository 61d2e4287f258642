// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Ctrl-C as a wish, not as an accident: the first SIGINT or SIGTERM sets a flag that the running command looks at, the
// second ends the process at once. One guard at a time.
#pragma once

#include <atomic>
#include <csignal>

namespace redag::cli {

class InterruptGuard {
 public:
  /// Installs the handlers; the destructor puts back what was there, unless there was a signal.
  InterruptGuard();
  ~InterruptGuard();
  InterruptGuard(const InterruptGuard &) = delete;
  InterruptGuard &operator=(const InterruptGuard &) = delete;

  /// Set by the first signal. Lock-free; any thread.
  [[nodiscard]] static const std::atomic<bool> &flag();
  [[nodiscard]] static bool interrupted() { return flag().load(std::memory_order_relaxed); }

 private:
  struct sigaction old_interrupt_ {};
  struct sigaction old_terminate_ {};
};

}  // namespace redag::cli
