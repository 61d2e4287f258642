// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The component that the stack comparisons run beside other people's: a control loop that measures how late it is
// called. It writes its figures as JSON to the file `report` when it is destroyed.
#include <chrono>
#include <cstdint>
#include <optional>
#include <string>

#include "rclcpp/rclcpp.hpp"
#include "rclcpp_components/register_node_macro.hpp"
#include "redag/threads/clock.hpp"
#include "samples.hpp"
#include "stack_nodes.hpp"
#include "timer_grid.hpp"

namespace redag_rclcpp::lab {

using redag::Duration;
using redag::Time;
using redag::runtime::monotonic_now;

/// A timer of `period` seconds, each call of which uses the processor for `load` seconds. Reports how late it was
/// called, and the points of its grid that it missed: those that no call was for, and calls that ended after the next
/// point. It measures for `seconds` after the first `warm_up` seconds; 0: to its end.
class Control : public rclcpp::Node {
 public:
  explicit Control(const rclcpp::NodeOptions &options)
      : Node("control", options),
        period_(read_seconds(*this, "period", 0.002)),
        load_(read_seconds(*this, "load", 0.0003)),
        warm_up_(read_seconds(*this, "warm_up", 2)),
        seconds_(read_seconds(*this, "seconds", 0)),
        report_(declare_parameter<std::string>("report", "")),
        grid_(period_),
        timer_(create_wall_timer(std::chrono::nanoseconds(period_), [this] { control(); })) {}
  Control(const Control &) = delete;
  Control &operator=(const Control &) = delete;

  ~Control() override {
    if (report_.empty()) return;
    write_report(*this, report_, {{"points", points_}, {"missed", missed_}, {"lateness", summary(latenesses_)}});
  }

 private:
  void control() {
    const TimerCall call = grid_.next(*timer_);
    const Time start = monotonic_now();
    use_processor(load_);
    if (!begin_) begin_ = start + warm_up_;
    if (start < *begin_ || (seconds_ > 0 && start >= *begin_ + seconds_)) return;
    points_ += call.skipped + 1;
    missed_ += call.skipped + (monotonic_now() > call.nominal + period_ ? 1 : 0);
    latenesses_.add(call.lateness);
  }

  Duration period_;
  Duration load_;
  Duration warm_up_;
  Duration seconds_;
  std::string report_;
  TimerGrid grid_;
  std::optional<Time> begin_;
  std::int64_t points_ = 0;
  std::int64_t missed_ = 0;
  Samples latenesses_;
  rclcpp::TimerBase::SharedPtr timer_;
};

}  // namespace redag_rclcpp::lab

RCLCPP_COMPONENTS_REGISTER_NODE(redag_rclcpp::lab::Control)
