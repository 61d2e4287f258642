// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "entities/callback.hpp"

#include <stdexcept>
#include <utility>

#include "redag/engine/running_job.hpp"

namespace redag_rclcpp {

using redag::sched::Outcome;

Outcome Callback::execute(const redag::runtime::Job &job) {
  redag::runtime::RunningJob::current()->owner = this;
  return run(job.release) ? Outcome::Finished : Outcome::NoData;
}

std::shared_ptr<ExecutorContext> Callback::context_now() const {
  const redag::LockGuard guard(lock_);
  if (!context_) throw redag::WaitCancelled{};  // the callback has left the executor
  return context_;
}

redag::runtime::DeviceHandle Callback::device(const std::string &name) const { return context_now()->device(name); }

void Callback::let_wait() const {
  const std::shared_ptr<ExecutorContext> context = context_now();
  if (!context->direct()) {
    throw std::logic_error(
        "redag_rclcpp::coroutine(): a callback can wait only while spin() runs it (spin_some(), spin_all(), "
        "spin_once() and spin_until_future_complete() have no worker that would go on with it)");
  }
  context->let_wait();
}

Callback &this_callback() {
  const redag::runtime::RunningJob *const running = redag::runtime::RunningJob::current();
  auto *const callback = running == nullptr ? nullptr : dynamic_cast<Callback *>(running->owner);
  if (callback != nullptr) return *callback;
  throw std::logic_error(
      "redag_rclcpp::coroutine(): the callback runs in no ReDAGExecutor (add its node to one, or use a callback that "
      "does not wait)");
}

std::shared_ptr<ExecutorContext> Callback::leave() {
  std::shared_ptr<ExecutorContext> context = std::exchange(context_, nullptr);
  if (context) context->timers().schedule(*this, redag::kNever);
  return context;
}

}  // namespace redag_rclcpp
