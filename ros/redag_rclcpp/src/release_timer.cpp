// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "release_timer.hpp"

namespace redag_rclcpp {

using redag::kNever;

void ReleaseTimer::stop() {
  pause();
  thread_.stop();
  thread_.join();
}

void ReleaseTimer::resume() {
  running_ = true;
  thread_.changed();
}

Time ReleaseTimer::expire() {
  const redag::LockGuard guard(expire_lock_);
  due_.clear();
  missed_.clear();
  const Time next = queue_.expire_due(engine_.now(), due_, missed_);
  engine_.miss(missed_, redag::Reason::Overrun);
  if (!due_.empty()) engine_.release(due_);
  return next;
}

// On the thread, or on that of a worker that waits in its place. A timer that is due again before its release is made
// must not take the processor from all jobs: after some releases in a row, they get the next stretch of time.
Time ReleaseTimer::release_due() {
  constexpr int kMostInARow = 8;
  constexpr Duration kShare = 10;  // of a processor, one part of that many
  for (Time next = queue_.next(); running_;) {
    const Time begun = engine_.now();
    if (next > begun) {
      in_a_row_ = 0;
      return next == kNever ? kNever : origin_ + next;
    }
    next = expire();
    const Time ended = engine_.now();
    if (next <= ended && ++in_a_row_ > kMostInARow) return origin_ + ended + (kShare - 1) * (ended - begun);
  }
  return kNever;
}

}  // namespace redag_rclcpp
