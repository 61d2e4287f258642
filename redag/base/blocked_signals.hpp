// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Keeps signal handlers off the threads that run jobs. Any thread.
#pragma once

#include <csignal>
#include <initializer_list>

namespace redag {

/// While it lives, the calling thread and threads that it creates take no signals but those that they cause themselves
/// (SIGSEGV, SIGBUS, SIGFPE, SIGILL, SIGTRAP, SIGSYS, SIGABRT). A handler of the process then interrupts a thread of
/// the program, never a job or a thread above all jobs.
class BlockedSignals {
 public:
  BlockedSignals() noexcept {
    sigset_t blocked;
    sigfillset(&blocked);
    for (const int own : {SIGSEGV, SIGBUS, SIGFPE, SIGILL, SIGTRAP, SIGSYS, SIGABRT}) sigdelset(&blocked, own);
    pthread_sigmask(SIG_BLOCK, &blocked, &before_);
  }
  ~BlockedSignals() { pthread_sigmask(SIG_SETMASK, &before_, nullptr); }
  BlockedSignals(const BlockedSignals &) = delete;
  BlockedSignals &operator=(const BlockedSignals &) = delete;

  /// The signals that were blocked before.
  [[nodiscard]] const sigset_t &before() const { return before_; }

 private:
  sigset_t before_{};
};

}  // namespace redag
