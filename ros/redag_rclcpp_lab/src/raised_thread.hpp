// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Raises the calling thread for a while, above busy workers.
#pragma once

#include <pthread.h>

#include "redag/threads/threads.hpp"

namespace redag_rclcpp::lab {

/// Gives the calling thread SCHED_FIFO `priority` until destruction; 0: leaves it unchanged.
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

}  // namespace redag_rclcpp::lab
