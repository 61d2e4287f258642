// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// ExecutorContext is the part of the executor that its callbacks use. Any thread may call it.
#pragma once

#include <memory>
#include <string>

#include "redag/engine/engine.hpp"
#include "redag/runtime/device_handle.hpp"
#include "timer_queue.hpp"

namespace redag_rclcpp {

class Callback;

class ExecutorContext {
 public:
  virtual ~ExecutorContext() = default;

  virtual redag::runtime::Engine &engine() = 0;
  virtual TimerQueue &timers() = 0;
  /// True if arrivals may be released to the scheduler at once. Otherwise note() collects callbacks with arrivals.
  [[nodiscard]] virtual bool direct() const = 0;
  /// Adds a callback to be admitted later. Takes no lock but its own.
  virtual void note(std::shared_ptr<Callback> callback) = 0;
  /// Wakes the thread that waits for work, after note(). The caller holds no lock of this package.
  virtual void wake() = 0;
  /// Called when the queue's next() has become earlier.
  virtual void timers_changed() = 0;
  /// Called when a job has handled an arrival that the wait set saw.
  virtual void wait_set_changed() = 0;
  /// Has the callback told of messages that no hook may have reported. The caller holds no lock of this package.
  virtual void look_for_leftovers(const std::shared_ptr<Callback> &callback) = 0;
  /// Called when a request or response has arrived. The caller holds no lock of this package.
  virtual void exchange_arrived() = 0;
  /// Called when a node or group may have other entities than before.
  virtual void entities_changed() = 0;
  /// For how long a callback learns, from its first arrival on; 0: it does not.
  [[nodiscard]] virtual redag::Duration learning_time() const = 0;
  /// Called when a callback knows its rate better than before. The caller holds no lock of this package.
  virtual void rate_seen() = 0;
  /// Called before a job can wait. The first call creates the engine's threads for that. Throws std::runtime_error if
  /// the system refuses them.
  virtual void let_wait() = 0;
  /// Throws std::out_of_range if the executor has no device of this name.
  [[nodiscard]] virtual redag::runtime::DeviceHandle device(const std::string &name) const = 0;
};

}  // namespace redag_rclcpp
