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
  for (const redag::runtime::Release &release : missed_) {
    engine_.miss(release.task, release.nominal, redag::Reason::Overrun);
  }
  if (!due_.empty()) engine_.release(due_);
  return next;
}

// On the thread, or on that of a worker that waits in its place.
Time ReleaseTimer::release_due() {
  for (Time next = queue_.next(); running_; next = expire()) {
    if (next > engine_.now()) return next == kNever ? kNever : origin_ + next;
  }
  return kNever;
}

}  // namespace redag_rclcpp
