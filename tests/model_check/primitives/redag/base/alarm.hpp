// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Replaces redag/base/alarm.hpp: its protocol of set() and ring() is the same, and the timer is a word of the explorer.
#pragma once

#include "redag/base/atomic.hpp"
#include "redag/base/time.hpp"

namespace redag {

class Alarm {
 public:
  [[nodiscard]] bool open() noexcept { return true; }
  void set(Time at) noexcept {
    arm(at);
    if (rung_.load()) arm(0);
  }
  void ring() noexcept {
    rung_.store(true);
    arm(0);
  }
  void wait() noexcept {
    for (Time at = at_; at > testing::explored::now(); at = at_) {
      static_cast<void>(testing::explored::wait(
          timer_, [&] { return at_ == at; }, at));
    }
    at_ = kNever;
    rung_.exchange(false);
  }

 private:
  // One operation: between two of them no other thread runs. A thread that it wakes finds the new time.
  void arm(Time at) noexcept {
    testing::explored::wake(timer_, 1);
    at_ = at;
  }

  Time at_ = kNever;
  testing::ObjectId timer_ = testing::explored::new_object();
  Atomic<bool> rung_{false};
};

}  // namespace redag
