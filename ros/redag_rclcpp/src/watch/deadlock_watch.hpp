// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// DeadlockWatch looks for deadlocks (DeadlockDetector) from time to time: while there are requests or responses that
// were not taken, or deadlocks that last. It logs them, and keeps them in Notes.
//
// Threads: the thread that spins calls everything but arrived(), which any thread may call.
#pragma once

#include <atomic>
#include <cstdint>
#include <vector>

#include "redag/engine/engine.hpp"
#include "task_table.hpp"
#include "watch/deadlock_detector.hpp"
#include "watch/notes.hpp"

namespace redag_rclcpp {

class DeadlockWatch {
 public:
  /// The other parts of the executor, which outlive this one.
  struct Parts {
    redag::runtime::Engine &engine;
    const TaskTable &tasks;
    Notes &notes;
  };
  /// `workers` of the executor.
  DeadlockWatch(const Parts &parts, std::uint32_t workers) : parts_(parts), workers_(workers) {}

  /// A request or response has arrived. True: the spinning thread must be woken to look().
  [[nodiscard]] bool arrived() { return !wanted_.load(std::memory_order_relaxed) && !wanted_.exchange(true); }
  /// Looks, if it is time to.
  void look();
  /// When to call look() again; kNever: after arrived().
  [[nodiscard]] redag::Time next_look() const { return next_look_; }
  /// No job is in progress any more: ends the deadlocks that lasted.
  void jobs_ended();

 private:
  void look_now();

  const Parts parts_;
  const std::uint32_t workers_;
  std::atomic<bool> wanted_{false};
  redag::Time next_look_ = redag::kNever;
  DeadlockDetector detector_;
  std::vector<redag::runtime::StartedJob> started_;  // for look_now()
};

}  // namespace redag_rclcpp
