// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// MiddlewareWatch exists while spin() runs with real-time threads. It raises the middleware's threads, looks again when
// new ones may have come, and logs what it finds. For one thread.
#pragma once

#include <string>

#include "rclcpp/context.hpp"
#include "redag/base/time.hpp"
#include "redag/threads/setup.hpp"
#include "watch/middleware_threads.hpp"
#include "watch/notes.hpp"

namespace redag_rclcpp {

class MiddlewareWatch {
 public:
  /// What outlives this object.
  struct Parts {
    rclcpp::Context &context;
    const redag::runtime::Setup &setup;
    Notes &notes;
    std::string &summary;  // that the log had last
  };
  /// `raise`: ReDAGOptions::raise_middleware. Otherwise it only looks.
  MiddlewareWatch(const Parts &parts, bool raise) : parts_(parts), raised_(raise ? parts.setup.timer_priority() : 0) {}

  /// The workers have begun: reports the threads that are there already.
  void begun(redag::Time now);
  /// Looks, if it is time to. `entities_came`: the middleware may create threads for them.
  void look(redag::Time now, bool entities_came);
  /// When to call look() again.
  [[nodiscard]] redag::Time next_look() const { return next_look_; }

 private:
  void report();

  const Parts parts_;
  RaisedMiddleware raised_;
  redag::Time next_look_ = redag::kNever;
};

}  // namespace redag_rclcpp
