// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/runtime/stop_signals.hpp"

#include <fmt/format.h>

#include <atomic>
#include <cerrno>
#include <cstring>
#include <ctime>
#include <stdexcept>

#include "redag/threads/clock.hpp"

namespace redag::runtime {
namespace {

// Two signals within this time count as one wish: timeout(1) signals the process and then its group.
constexpr Duration kSameWish = 200 * kMillisecond;

// What the handler uses. It can run in any thread, also while another one runs the destructor.
std::atomic<Executor *> running{nullptr};
std::atomic<int> in_handler{0};
std::atomic<int> first_signal{0};
std::atomic<Time> first_at{0};
static_assert(std::atomic<Executor *>::is_always_lock_free && std::atomic<int>::is_always_lock_free &&
              std::atomic<Time>::is_always_lock_free);

// Async-signal-safe: atomics, clock_gettime, sigaction, raise, and request_stop().
void on_signal(int number) {
  const int error = errno;
  in_handler.fetch_add(1);
  const Time now = monotonic_now();
  Time first = 0;
  if (first_at.compare_exchange_strong(first, now)) {
    first_signal.store(number);
    if (Executor *executor = running.load()) executor->request_stop();
  } else if (now - first > kSameWish) {
    struct sigaction ordinary {};
    ordinary.sa_handler = SIG_DFL;
    sigaction(number, &ordinary, nullptr);
    raise(number);  // takes effect when this handler has returned
  }
  in_handler.fetch_sub(1);
  errno = error;
}

}  // namespace

StopSignals::StopSignals(Executor &executor, std::initializer_list<int> signals) {
  Executor *none = nullptr;
  if (!running.compare_exchange_strong(none, &executor)) {
    throw std::logic_error("Executor::run_until_signal(): another executor of this process handles the signals");
  }
  first_signal.store(0);
  first_at.store(0);
  struct sigaction action {};
  action.sa_handler = on_signal;
  action.sa_flags = SA_RESTART;
  sigemptyset(&action.sa_mask);
  for (const int number : signals) {
    struct sigaction previous {};
    if (sigaction(number, nullptr, &previous) == 0 && previous.sa_handler == SIG_IGN) continue;
    if (sigaction(number, &action, &previous) != 0) {
      const int error = errno;
      restore();
      throw std::invalid_argument(
          fmt::format("Executor::run_until_signal(): signal {}: {}", number, std::strerror(error)));
    }
    previous_.emplace_back(number, previous);
  }
}

StopSignals::~StopSignals() { restore(); }

int StopSignals::received() const noexcept { return first_signal.load(); }

void StopSignals::restore() noexcept {
  for (const auto &[number, previous] : previous_) sigaction(number, &previous, nullptr);
  running.store(nullptr);
  // A handler in another thread may have read `running` before. It is over in less than a microsecond of that thread's
  // time, which may have a lower priority than this one.
  while (in_handler.load() != 0) {
    const timespec moment{0, 50'000};
    ::nanosleep(&moment, nullptr);
  }
}

}  // namespace redag::runtime
