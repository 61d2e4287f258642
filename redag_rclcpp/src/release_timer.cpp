// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "release_timer.hpp"

#include <utility>

#include "redag/runtime/threads.hpp"

namespace redag_rclcpp {

using redag::kNever;

redag::Result<void> ReleaseTimer::start(int priority) {
  if (thread_.joinable()) return {};
  redag::Result<std::thread> started = redag::runtime::start_thread({"redag-timer", priority, {}}, [this] { run(); });
  if (!started) return tl::unexpected(std::move(started.error()));
  thread_ = *std::move(started);
  return {};
}

void ReleaseTimer::stop() {
  exit_ = true;
  parker_.unpark();
  if (thread_.joinable()) thread_.join();
}

void ReleaseTimer::resume() {
  running_ = true;
  parker_.unpark();
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

Time ReleaseTimer::release_due() {
  if (!running_) return kNever;
  Time next = queue_.next();
  if (next != kNever && next <= engine_.now()) next = expire();
  return next == kNever ? kNever : origin_ + next;
}

void ReleaseTimer::run() noexcept {
  while (!exit_) {
    const Time next = running_ ? expire() : kNever;
    if (next == kNever) {
      parker_.park();
    } else if (next > engine_.now()) {
      parker_.park_until(origin_ + next);
    }
  }
}

}  // namespace redag_rclcpp
