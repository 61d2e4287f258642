// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The components around rosbag2's Recorder and Player for bench_rosbag2: sensors whose messages are recorded, and a
// listener to what is played. The listener writes its figures as JSON to the file `report` when it is destroyed.
#include <chrono>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "rclcpp/rclcpp.hpp"
#include "rclcpp_components/register_node_macro.hpp"
#include "redag/threads/clock.hpp"
#include "samples.hpp"
#include "sensor_msgs/image_encodings.hpp"
#include "sensor_msgs/msg/image.hpp"
#include "sensor_msgs/msg/imu.hpp"
#include "stack_nodes.hpp"

namespace redag_rclcpp::lab {

using redag::Time;
using redag::runtime::monotonic_now;
using sensor_msgs::msg::Image;
using sensor_msgs::msg::Imu;

/// A camera and several inertial units. Each message has its number in `header.frame_id`, hence a recording shows which
/// ones it lacks. All publishers have rclcpp's default quality of service: reliable, with the last ten messages.
class Sensors : public rclcpp::Node {
 public:
  explicit Sensors(const rclcpp::NodeOptions &options) : Node("sensors", options) {
    image_.encoding = sensor_msgs::image_encodings::BAYER_RGGB8;
    image_.width = static_cast<std::uint32_t>(declare_parameter<int>("width", 640));
    image_.height = static_cast<std::uint32_t>(declare_parameter<int>("height", 480));
    image_.step = image_.width;
    image_.data.resize(std::size_t{image_.step} * image_.height);
    for (std::size_t i = 0; i < image_.data.size(); ++i) image_.data[i] = static_cast<std::uint8_t>(i);
    images_ = create_publisher<Image>("/camera", 10);
    const auto units = declare_parameter<int>("units", 4);
    for (std::int64_t i = 0; i < units; ++i) imus_.push_back(create_publisher<Imu>("/imu_" + std::to_string(i), 10));
    const auto image_period = std::chrono::nanoseconds(read_seconds(*this, "image_period", 1.0 / 30));
    const auto imu_period = std::chrono::nanoseconds(read_seconds(*this, "imu_period", 0.004));
    timers_.push_back(create_wall_timer(image_period, [this] {
      image_.header.stamp = now();
      image_.header.frame_id = std::to_string(image_number_++);
      images_->publish(image_);
    }));
    timers_.push_back(create_wall_timer(imu_period, [this] {
      imu_.header.stamp = now();
      imu_.header.frame_id = std::to_string(imu_number_++);
      for (const auto &publisher : imus_) publisher->publish(imu_);
    }));
  }

 private:
  Image image_;
  Imu imu_;
  std::uint64_t image_number_ = 0;
  std::uint64_t imu_number_ = 0;
  rclcpp::Publisher<Image>::SharedPtr images_;
  std::vector<rclcpp::Publisher<Imu>::SharedPtr> imus_;
  std::vector<rclcpp::TimerBase::SharedPtr> timers_;
};

/// Subscribes to `replayed`. Reports how many messages came and how many did not, by the numbers in their headers, and
/// how far the time between two of them was from `period` seconds. Leaves out the first `warm_up` seconds.
class Listener : public rclcpp::Node {
 public:
  explicit Listener(const rclcpp::NodeOptions &options)
      : Node("listener", options),
        period_(read_seconds(*this, "period", 0.01)),
        warm_up_(read_seconds(*this, "warm_up", 2)),
        report_(declare_parameter<std::string>("report", "")),
        subscription_(create_subscription<Imu>("replayed", 10, [this](const Imu &message) { hear(message); })) {}
  Listener(const Listener &) = delete;
  Listener &operator=(const Listener &) = delete;

  ~Listener() override {
    if (report_.empty()) return;
    write_report(*this, report_, {{"heard", heard_}, {"lost", lost_}, {"off", summary(off_)}});
  }

 private:
  void hear(const Imu &message) {
    const Time now = monotonic_now();
    if (!begin_) begin_ = now + warm_up_;
    if (now < *begin_) return;
    const std::int64_t number = std::stoll(message.header.frame_id);
    ++heard_;
    if (last_number_) {
      lost_ += number - *last_number_ - 1;
      off_.add(std::abs(now - last_ - period_ * (number - *last_number_)));
    }
    last_number_ = number;
    last_ = now;
  }

  redag::Duration period_;
  redag::Duration warm_up_;
  std::string report_;
  std::optional<Time> begin_;
  std::optional<std::int64_t> last_number_;
  Time last_ = 0;
  std::int64_t heard_ = 0;
  std::int64_t lost_ = 0;
  Samples off_;
  rclcpp::Subscription<Imu>::SharedPtr subscription_;
};

}  // namespace redag_rclcpp::lab

RCLCPP_COMPONENTS_REGISTER_NODE(redag_rclcpp::lab::Sensors)
RCLCPP_COMPONENTS_REGISTER_NODE(redag_rclcpp::lab::Listener)
