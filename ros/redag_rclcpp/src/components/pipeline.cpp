// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Example components for the container: a sensor (timer), a filter and a controller (subscriptions). Each uses the
// processor for the time that its parameter `load` states. The executor shows its worth with two such pipelines at
// different rates.
#include <time.h>

#include <chrono>
#include <cstdint>
#include <memory>

#include "rclcpp/rclcpp.hpp"
#include "rclcpp_components/register_node_macro.hpp"
#include "redag/engine/preemption_point.hpp"
#include "std_msgs/msg/float64.hpp"

namespace redag_rclcpp::examples {

using std::chrono::nanoseconds;
using std_msgs::msg::Float64;

namespace {

nanoseconds read_seconds(rclcpp::Node &node, const char *name, double initial) {
  return std::chrono::duration_cast<nanoseconds>(
      std::chrono::duration<double>(node.declare_parameter<double>(name, initial)));
}

nanoseconds thread_time() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return std::chrono::seconds(now.tv_sec) + nanoseconds(now.tv_nsec);
}

/// Uses `load` of processor time. In cooperative mode a more urgent callback can run at each preemption point; its
/// processor time on this thread is not counted.
void compute(nanoseconds load) {
  constexpr nanoseconds kRegion = std::chrono::microseconds(100);
  for (nanoseconds used(0); used < load;) {
    const nanoseconds start = thread_time();
    const nanoseconds region = std::min(kRegion, load - used);
    while (thread_time() - start < region) {
    }
    used += region;
    redag::preemption_point();
  }
}

}  // namespace

/// Publishes on `samples` every `period` seconds, after using the processor for `load` seconds.
class Sensor : public rclcpp::Node {
 public:
  explicit Sensor(const rclcpp::NodeOptions &options)
      : Node("sensor", options),
        load_(read_seconds(*this, "load", 0.0002)),
        publisher_(create_publisher<Float64>("samples", 1)),
        timer_(create_wall_timer(read_seconds(*this, "period", 0.01), [this] { sample(); })) {}

 private:
  void sample() {
    compute(load_);
    Float64 message;
    message.data = static_cast<double>(++count_);
    publisher_->publish(message);
  }

  nanoseconds load_;
  std::uint64_t count_ = 0;
  rclcpp::Publisher<Float64>::SharedPtr publisher_;
  rclcpp::TimerBase::SharedPtr timer_;
};

/// Publishes an `estimate` for each of the `samples`.
class Filter : public rclcpp::Node {
 public:
  explicit Filter(const rclcpp::NodeOptions &options)
      : Node("filter", options),
        load_(read_seconds(*this, "load", 0.0005)),
        publisher_(create_publisher<Float64>("estimate", 1)),
        subscription_(create_subscription<Float64>("samples", 1, [this](const Float64 &sample) { estimate(sample); })) {
  }

 private:
  void estimate(const Float64 &sample) {
    compute(load_);
    constexpr double kGain = 0.25;
    Float64 message;
    message.data = state_ += kGain * (sample.data - state_);
    publisher_->publish(message);
  }

  nanoseconds load_;
  double state_ = 0;
  rclcpp::Publisher<Float64>::SharedPtr publisher_;
  rclcpp::Subscription<Float64>::SharedPtr subscription_;
};

/// Publishes a `command` for each `estimate`.
class Control : public rclcpp::Node {
 public:
  explicit Control(const rclcpp::NodeOptions &options)
      : Node("control", options),
        load_(read_seconds(*this, "load", 0.0002)),
        publisher_(create_publisher<Float64>("command", 1)),
        subscription_(
            create_subscription<Float64>("estimate", 1, [this](const Float64 &estimate) { actuate(estimate); })) {}

 private:
  void actuate(const Float64 &estimate) {
    compute(load_);
    constexpr double kGain = -0.5;
    Float64 message;
    message.data = kGain * estimate.data;
    publisher_->publish(message);
  }

  nanoseconds load_;
  rclcpp::Publisher<Float64>::SharedPtr publisher_;
  rclcpp::Subscription<Float64>::SharedPtr subscription_;
};

}  // namespace redag_rclcpp::examples

RCLCPP_COMPONENTS_REGISTER_NODE(redag_rclcpp::examples::Sensor)
RCLCPP_COMPONENTS_REGISTER_NODE(redag_rclcpp::examples::Filter)
RCLCPP_COMPONENTS_REGISTER_NODE(redag_rclcpp::examples::Control)
