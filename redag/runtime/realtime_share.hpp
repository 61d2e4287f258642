// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Keeps account of what SCHED_FIFO threads use of each processor, so that some can leave the real-time class before the
// kernel stops all of them (real-time throttling). A value: time is an argument, in ns. Not thread-safe.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "redag/base/time.hpp"

namespace redag::runtime {

/// The kernel's setting: SCHED_FIFO threads may use `runtime_us` of each `period_us` of a processor.
struct Throttling {
  std::int64_t runtime_us = 0;
  std::int64_t period_us = 0;
};

/// A token bucket for each processor. Its credit falls while real-time threads run there, and is refilled all the time.
/// Once it is empty, real-time threads pause until it is half full. They then never use `runtime` in any `period`,
/// which leaves room for uncounted work. Nothing allocates after construction.
class RealtimeShare {
 public:
  explicit RealtimeShare(const Throttling &throttling, std::size_t processors = 1);

  [[nodiscard]] std::size_t processors() const { return accounts_.size(); }

  /// Marks processors where real-time threads have also run since the last set_busy() or used_up(). The mark lasts
  /// until set_busy().
  void ran_on(std::size_t processor) { accounts_[processor].busy = true; }
  void ran_everywhere();
  /// From `now` on, real-time threads run on the given processors, or on all or none. Time does not go back: an earlier
  /// `now` counts as the last one.
  void set_busy(const std::vector<bool> &busy, Time now);
  void set_busy(bool busy, Time now);
  /// Returns true from when the credit of a processor is used up until it is half full again.
  [[nodiscard]] bool used_up(Time now);
  /// Returns the shortest time after which used_up() can change, if processors stay as busy as at the last call.
  [[nodiscard]] Duration until_change() const;

 private:
  struct Account {
    Duration credit = 0;
    bool busy = false;
    bool used_up = false;
  };

  void settle(Time now);
  [[nodiscard]] Duration time_for(Duration credit, double rate) const;

  Duration period_;
  Duration burst_;  // the most credit
  double share_;    // credit refilled in a unit of time
  std::vector<Account> accounts_;
  Time settled_ = 0;
  bool used_up_ = false;  // on some processor
};

}  // namespace redag::runtime
