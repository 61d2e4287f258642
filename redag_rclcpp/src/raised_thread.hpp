// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// A thread that must not wait for busy workers, for a while.
#pragma once

#include <pthread.h>

#include "redag/runtime/threads.hpp"

namespace redag_rclcpp {

/// The calling thread at SCHED_FIFO `priority` for as long as this lives; 0: as it is.
class RaisedThread {
 public:
  explicit RaisedThread(int priority) {
    if (priority == 0 || pthread_getschedparam(pthread_self(), &policy_, &parameters_) != 0) return;
    raised_ = redag::runtime::set_fifo_priority(pthread_self(), priority);
  }
  ~RaisedThread() {
    if (raised_) pthread_setschedparam(pthread_self(), policy_, &parameters_);
  }
  RaisedThread(const RaisedThread &) = delete;
  RaisedThread &operator=(const RaisedThread &) = delete;

 private:
  bool raised_ = false;
  int policy_ = 0;
  sched_param parameters_{};
};

}  // namespace redag_rclcpp
