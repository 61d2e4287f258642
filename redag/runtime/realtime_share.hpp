// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// What SCHED_FIFO threads may use of each processor before the kernel takes it from all of them (real-time throttling),
// kept as a credit, so that some of them can leave the real-time class in time. A value: time is an argument, in ns.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "redag/base/time.hpp"

namespace redag::runtime {

/// The kernel's setting: what SCHED_FIFO threads may use of each `period_us` of a processor.
struct Throttling {
  std::int64_t runtime_us = 0;
  std::int64_t period_us = 0;
};

/// A processor's credit goes while real-time threads run there, and comes back all the time. If none of them runs from
/// when it is used up until half of it is there again, they never use `runtime` in any `period`: room is left for what
/// is not counted. As the kernel's own account, each processor's is by itself. Nothing allocates after construction.
class RealtimeShare {
 public:
  explicit RealtimeShare(const Throttling &throttling, std::size_t processors = 1);

  [[nodiscard]] std::size_t processors() const { return accounts_.size(); }

  /// Real-time threads have run there, too, since the last call of the next two; until set_busy() they still do.
  void ran_on(std::size_t processor) { accounts_[processor].busy = true; }
  void ran_everywhere();
  /// From `now` on real-time threads run on those processors, or on all or none. Time does not go back: a `now` before
  /// the last one counts as it.
  void set_busy(const std::vector<bool> &busy, Time now);
  void set_busy(bool busy, Time now);
  /// From when the credit of some processor is used up until half of it is there again.
  [[nodiscard]] bool used_up(Time now);
  /// As things were at the last call: when used_up() changes at the earliest, in so much time.
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
  double share_;    // credit that comes back in a unit of time
  std::vector<Account> accounts_;
  Time settled_ = 0;
  bool used_up_ = false;  // of some processor
};

}  // namespace redag::runtime
