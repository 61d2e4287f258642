// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The components around image_proc's for bench_image_pipeline: a synthetic camera, and a viewer that measures how old
// its frames are. The viewer writes its figures as JSON to the file `report` when it is destroyed. It leaves out the
// first `warm_up` seconds.
#include <chrono>
#include <cmath>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "rclcpp/rclcpp.hpp"
#include "rclcpp_components/register_node_macro.hpp"
#include "redag/threads/clock.hpp"
#include "samples.hpp"
#include "sensor_msgs/image_encodings.hpp"
#include "sensor_msgs/msg/camera_info.hpp"
#include "sensor_msgs/msg/image.hpp"
#include "stack_nodes.hpp"
#include "timer_grid.hpp"

namespace redag_rclcpp::lab {

using redag::Duration;
using redag::Time;
using redag::runtime::monotonic_now;
using sensor_msgs::msg::CameraInfo;
using sensor_msgs::msg::Image;

/// Publishes `image_raw` (a Bayer pattern) and `camera_info` (of a lens with distortion) every `period` seconds. A
/// frame's stamp is the time at which the timer should have called.
class Camera : public rclcpp::Node {
 public:
  explicit Camera(const rclcpp::NodeOptions &options)
      : Node("camera", options), period_(read_seconds(*this, "period", 1.0 / 30)), grid_(period_) {
    image_.encoding = sensor_msgs::image_encodings::BAYER_RGGB8;
    image_.width = static_cast<std::uint32_t>(declare_parameter<int>("width", 640));
    image_.height = static_cast<std::uint32_t>(declare_parameter<int>("height", 480));
    image_.step = image_.width;
    image_.header.frame_id = "camera";
    image_.data.resize(std::size_t{image_.step} * image_.height);
    for (std::size_t i = 0; i < image_.data.size(); ++i) {
      image_.data[i] = static_cast<std::uint8_t>(i % image_.width + i / image_.width);
    }
    info_.header.frame_id = "camera";
    info_.width = image_.width;
    info_.height = image_.height;
    info_.distortion_model = "plumb_bob";
    info_.d = {-0.3, 0.1, 0.001, -0.001, 0};
    const double focal = 0.8 * image_.width;
    const double x = image_.width / 2.0;
    const double y = image_.height / 2.0;
    info_.k = {focal, 0, x, 0, focal, y, 0, 0, 1};
    info_.r = {1, 0, 0, 0, 1, 0, 0, 0, 1};
    info_.p = {focal, 0, x, 0, 0, focal, y, 0, 0, 0, 1, 0};
    images_ = create_publisher<Image>("image_raw", rclcpp::SensorDataQoS());
    infos_ = create_publisher<CameraInfo>("camera_info", rclcpp::SensorDataQoS());
    timer_ = create_wall_timer(std::chrono::nanoseconds(period_), [this] { capture(); });
  }

 private:
  void capture() {
    const TimerCall call = grid_.next(*timer_);
    image_.header.stamp = now() - rclcpp::Duration(std::chrono::nanoseconds(monotonic_now() - call.nominal));
    info_.header.stamp = image_.header.stamp;
    images_->publish(image_);
    infos_->publish(info_);
  }

  Duration period_;
  TimerGrid grid_;
  Image image_;
  CameraInfo info_;
  rclcpp::Publisher<Image>::SharedPtr images_;
  rclcpp::Publisher<CameraInfo>::SharedPtr infos_;
  rclcpp::TimerBase::SharedPtr timer_;
};

/// Subscribes to `image`. Reports the age of the frames at their arrival, and how many of the camera's frames (one
/// every `period` seconds) did not come.
class Viewer : public rclcpp::Node {
 public:
  explicit Viewer(const rclcpp::NodeOptions &options)
      : Node("viewer", options),
        period_(read_seconds(*this, "period", 1.0 / 30)),
        warm_up_(read_seconds(*this, "warm_up", 2)),
        report_(declare_parameter<std::string>("report", "")),
        subscription_(create_subscription<Image>("image", rclcpp::SensorDataQoS(),
                                                 [this](Image::ConstSharedPtr image) { view(*image); })) {}
  Viewer(const Viewer &) = delete;
  Viewer &operator=(const Viewer &) = delete;

  ~Viewer() override {
    if (report_.empty()) return;
    const std::int64_t expected =
        latencies_.size() == 0
            ? 0
            : std::llround(static_cast<double>(last_stamp_ - first_stamp_) / static_cast<double>(period_)) + 1;
    write_report(*this, report_,
                 {{"frames", latencies_.size()},
                  {"lost", expected - static_cast<std::int64_t>(latencies_.size())},
                  {"latency", summary(latencies_)}});
  }

 private:
  void view(const Image &image) {
    const Time arrival = now().nanoseconds();
    if (!begin_) begin_ = arrival + warm_up_;
    const Time stamp = rclcpp::Time(image.header.stamp).nanoseconds();
    if (stamp < *begin_) return;
    if (latencies_.size() == 0) first_stamp_ = stamp;
    last_stamp_ = stamp;
    latencies_.add(arrival - stamp);
  }

  Duration period_;
  Duration warm_up_;
  std::string report_;
  std::optional<Time> begin_;
  Time first_stamp_ = 0;
  Time last_stamp_ = 0;
  Samples latencies_;
  rclcpp::Subscription<Image>::SharedPtr subscription_;
};

}  // namespace redag_rclcpp::lab

RCLCPP_COMPONENTS_REGISTER_NODE(redag_rclcpp::lab::Camera)
RCLCPP_COMPONENTS_REGISTER_NODE(redag_rclcpp::lab::Viewer)
