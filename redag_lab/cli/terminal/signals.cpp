// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/cli/terminal/signals.hpp"

#include <unistd.h>

#include "redag/base/check.hpp"
#include "redag/base/time.hpp"
#include "redag/threads/clock.hpp"

namespace redag::cli {
namespace {

std::atomic<bool> interrupt_flag{false};
std::atomic<Time> first_signal{0};
static_assert(std::atomic<bool>::is_always_lock_free && std::atomic<Time>::is_always_lock_free);

// Two signals within this time count as one request: timeout(1) signals the process and then its group. A second Ctrl-C
// by hand takes longer.
constexpr Duration kSameWish = 200 * kMillisecond;

// Async-signal-safe: atomics, clock_gettime and _exit.
void on_signal(int number) {
  constexpr int kSignalExit = 128;  // as shells report a death by signal
  const Time now = runtime::monotonic_now();
  Time first = 0;
  if (first_signal.compare_exchange_strong(first, now)) {
    interrupt_flag.store(true);
  } else if (now - first > kSameWish) {
    _exit(kSignalExit + number);
  }
}

}  // namespace

InterruptGuard::InterruptGuard() {
  first_signal.store(0);
  interrupt_flag.store(false);
  struct sigaction action {};
  action.sa_handler = on_signal;
  action.sa_flags = SA_RESTART;
  sigemptyset(&action.sa_mask);
  REDAG_CHECK(sigaction(SIGINT, &action, &old_interrupt_) == 0, "cannot install the handler of SIGINT");
  REDAG_CHECK(sigaction(SIGTERM, &action, &old_terminate_) == 0, "cannot install the handler of SIGTERM");
}

// After an interrupt the handlers stay. The program is about to end, and a duplicate signal must not kill it before.
InterruptGuard::~InterruptGuard() {
  if (interrupted()) return;
  sigaction(SIGINT, &old_interrupt_, nullptr);
  sigaction(SIGTERM, &old_terminate_, nullptr);
}

const std::atomic<bool> &InterruptGuard::flag() { return interrupt_flag; }

}  // namespace redag::cli
