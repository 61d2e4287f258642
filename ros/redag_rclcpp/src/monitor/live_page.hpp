// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Shows an executor in `redag top`: a page of shared memory, and a thread of normal priority that updates it.
#pragma once

#include <map>
#include <memory>
#include <string>

#include "redag/base/lock_guard.hpp"
#include "redag/base/mutex.hpp"
#include "redag/live/publisher.hpp"
#include "redag_rclcpp/executor.hpp"

namespace redag_rclcpp {

class LivePage {
 public:
  /// `executor` outlives it. If the system refuses the page, there is none, and the log says why.
  explicit LivePage(const ReDAGExecutor &executor);

  [[nodiscard]] bool exists() const { return publisher_ != nullptr; }

  /// Bounds on response times to show, by CallbackStats::task.
  void set_bounds(std::map<std::string, redag::Duration> bounds) {
    const redag::LockGuard guard(lock_);
    bounds_ = std::move(bounds);
  }

 private:
  void fill(redag::live::Sample &sample) const;
  [[nodiscard]] std::string alert() const;

  const ReDAGExecutor &executor_;
  mutable redag::Mutex lock_;
  std::map<std::string, redag::Duration> bounds_ REDAG_GUARDED_BY(lock_);
  std::unique_ptr<redag::live::Publisher> publisher_;  // last member: it calls fill() until it is destroyed
};

}  // namespace redag_rclcpp
