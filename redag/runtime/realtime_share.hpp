// What SCHED_FIFO threads may use of a processor before the kernel takes it from all of them (real-time throttling),
// kept as a credit, so that some of them can leave the real-time class in time. A value: time is an argument, in ns.
#pragma once

#include <cstdint>

#include "redag/base/time.hpp"

namespace redag::runtime {

/// The kernel's setting: what SCHED_FIFO threads may use of each `period_us` of a processor.
struct Throttling {
  std::int64_t runtime_us = 0;
  std::int64_t period_us = 0;
};

/// Credit goes while real-time threads run, and comes back all the time. If none of them runs from when it is used up
/// until half of it is there again, they never use `runtime` in any `period`: room is left for what is not counted.
/// Several processors are taken for one that is busy while any of them is, since the kernel chooses where threads run.
class RealtimeShare {
 public:
  explicit RealtimeShare(const Throttling &throttling);

  /// From `now` on real-time threads run, or none does. Time does not go back: a `now` before the last one counts as
  /// it.
  void set_busy(bool busy, Time now);
  /// From when the credit is used up until half of it is there again.
  [[nodiscard]] bool used_up(Time now);
  /// As things were at the last call: when used_up() changes at the earliest, in so much time.
  [[nodiscard]] Duration until_change() const;

 private:
  void settle(Time now);

  Duration period_;
  Duration burst_;  // the most credit
  double share_;    // credit that comes back in a unit of time
  Duration credit_;
  Time settled_ = 0;
  bool busy_ = false;
  bool used_up_ = false;
};

}  // namespace redag::runtime
