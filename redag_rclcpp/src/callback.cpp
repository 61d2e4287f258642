// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "callback.hpp"

#include <utility>

#include "redag/runtime/running_job.hpp"

namespace redag_rclcpp {

using redag::sched::Outcome;

Outcome Callback::execute(const redag::runtime::Job &job) {
  if (!run()) return Outcome::NoData;
  redag::runtime::RunningJob &running = *redag::runtime::RunningJob::current();
  running.close();
  const Duration response = running.ended - job.release;
  response_.add(response);
  if (response > deadline()) count_late();
  execution_.add(running.charged);
  return Outcome::Finished;
}

std::shared_ptr<ExecutorContext> Callback::leave() {
  std::shared_ptr<ExecutorContext> context = std::exchange(context_, nullptr);
  if (context) context->timers().schedule(*this, redag::kNever);
  return context;
}

}  // namespace redag_rclcpp
