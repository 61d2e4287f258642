#include "redag/cli/signals.hpp"

#include <unistd.h>

#include "redag/base/check.hpp"

namespace redag::cli {
namespace {

std::atomic<bool> interrupt_flag{false};
static_assert(std::atomic<bool>::is_always_lock_free);

// Async-signal-safe: an atomic and _exit.
void on_signal(int number) {
  constexpr int kSignalExit = 128;  // as a shell reports a death by signal
  if (interrupt_flag.exchange(true)) _exit(kSignalExit + number);
}

}  // namespace

InterruptGuard::InterruptGuard() {
  interrupt_flag.store(false);
  struct sigaction action {};
  action.sa_handler = on_signal;
  action.sa_flags = SA_RESTART;
  sigemptyset(&action.sa_mask);
  REDAG_CHECK(sigaction(SIGINT, &action, &old_interrupt_) == 0, "no handler for SIGINT");
  REDAG_CHECK(sigaction(SIGTERM, &action, &old_terminate_) == 0, "no handler for SIGTERM");
}

InterruptGuard::~InterruptGuard() {
  sigaction(SIGINT, &old_interrupt_, nullptr);
  sigaction(SIGTERM, &old_terminate_, nullptr);
}

const std::atomic<bool> &InterruptGuard::flag() { return interrupt_flag; }

}  // namespace redag::cli
