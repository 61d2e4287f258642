// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Learning decides when callbacks get the rates that they have seen. A rate that a callback sees or knows better is
// adopted at the next look. When the learning window of the executor is over, the log says how many there are.
//
// Threads: the thread that spins calls begin(), look() and next_look(). Any thread may call the rest.
#pragma once

#include <atomic>

#include "redag/base/time.hpp"
#include "registry.hpp"

namespace redag_rclcpp {

class Learning {
 public:
  /// `window`: ReDAGOptions::learn; 0: no learning. The registry outlives this object.
  Learning(Registry &registry, redag::Duration window) : registry_(registry), window_(window) {}

  /// Begins the window at the first call. Call it at the beginning of each spin function.
  void begin(redag::Time now);
  /// Gives callbacks the rates that were seen since the last look, and ends the window when it is over.
  void look(redag::Time now);
  /// When the window ends, as long as it lasts; otherwise kNever.
  [[nodiscard]] redag::Time next_look() const { return learning_ ? until_ : redag::kNever; }

  /// A callback knows its rate better than before. True: the spinning thread must be woken to look().
  [[nodiscard]] bool rate_seen() { return !rate_seen_.exchange(true); }
  /// For how long a callback learns, from its first arrival on; 0: it does not.
  [[nodiscard]] redag::Duration time() const { return begun_ ? window_ : 0; }
  /// True once the window is over, or if there is none.
  [[nodiscard]] bool done() const { return window_ <= 0 || done_; }

 private:
  Registry &registry_;
  const redag::Duration window_;
  redag::Time until_ = redag::kNever;
  bool learning_ = false;
  std::atomic<bool> begun_{false};
  std::atomic<bool> done_{false};
  std::atomic<bool> rate_seen_{false};
};

}  // namespace redag_rclcpp
