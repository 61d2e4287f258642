// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_rclcpp/join.hpp"

#include <rcl/wait.h>

#include <algorithm>

#include "entities/wait_set_member.hpp"
#include "redag/base/lock_guard.hpp"

namespace redag_rclcpp {

void JoinBase::set_on_ready_callback(std::function<void(std::size_t, int)> callback) {
  {
    const redag::LockGuard guard(hook_lock_);
    on_ready_ = std::move(callback);
    told_ = false;
  }
  // Reports messages that have come before.
  for (std::size_t i = 0; i < inputs_.size(); ++i) {
    inputs_[i].subscription->set_on_new_message_callback([this, i](std::size_t) { arrived(i); });
  }
}

void JoinBase::clear_on_ready_callback() {
  for (const Input &input : inputs_) input.subscription->clear_on_new_message_callback();
  const redag::LockGuard guard(hook_lock_);
  on_ready_ = nullptr;
}

void JoinBase::fill(rcl_wait_set_t &set) {
  for (const Input &input : inputs_) {
    check_rcl(rcl_wait_set_add_subscription(&set, input.subscription->get_subscription_handle().get(), nullptr),
              "cannot wait for a topic of a join");
  }
}

void JoinBase::arrived(std::size_t input) {
  const redag::LockGuard guard(hook_lock_);
  inputs_[input].arrived = true;
  tell_if_complete();
}

// A message that came during take() may be taken already. The job then finds no set, and nothing is lost.
void JoinBase::tell_if_complete() {
  const auto has_message = [](const Input &input) { return input.arrived || input.kept; };
  if (told_ || !on_ready_ || !std::all_of(inputs_.begin(), inputs_.end(), has_message)) return;
  told_ = true;
  on_ready_(1, 0);
}

// A wait set returns at once while a subscription has messages. Therefore they are taken even if there is no set.
bool JoinBase::take() {
  const redag::LockGuard guard(lock_);
  {
    const redag::LockGuard hook_guard(hook_lock_);
    told_ = false;
    for (Input &input : inputs_) input.arrived = false;
  }
  for (std::size_t i = 0; i < inputs_.size(); ++i) take_from(i);
  const redag::LockGuard hook_guard(hook_lock_);
  note_kept();
  return has_set();
}

void JoinBase::note_kept() {
  for (std::size_t i = 0; i < inputs_.size(); ++i) inputs_[i].kept = keeps_message_of(i);
}

void JoinBase::run(const std::shared_ptr<void> & /*data*/) {
  (void)take();
  for (;;) {
    std::function<void()> call;
    {
      const redag::LockGuard guard(lock_);
      if (!has_set()) break;
      call = use_set();
    }
    call();
  }
  const redag::LockGuard guard(lock_);
  const redag::LockGuard hook_guard(hook_lock_);
  note_kept();
  if (std::any_of(inputs_.begin(), inputs_.end(), [](const Input &input) { return input.arrived; })) tell_if_complete();
}

}  // namespace redag_rclcpp
