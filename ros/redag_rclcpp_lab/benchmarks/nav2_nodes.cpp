// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The robot around Nav2 for bench_nav2: a base, which drives as it is told and tells where it is, and a lidar, which
// sees the hall of nav2_world.hpp. The base notes commands as JSON in the file `report` when it is destroyed.
#include <chrono>
#include <cmath>
#include <cstdint>
#include <limits>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "geometry_msgs/msg/point_stamped.hpp"
#include "geometry_msgs/msg/transform_stamped.hpp"
#include "geometry_msgs/msg/twist_stamped.hpp"
#include "nav2_world.hpp"
#include "nav_msgs/msg/occupancy_grid.hpp"
#include "nav_msgs/msg/odometry.hpp"
#include "rclcpp/rclcpp.hpp"
#include "rclcpp_components/register_node_macro.hpp"
#include "redag/base/time.hpp"
#include "sensor_msgs/msg/laser_scan.hpp"
#include "stack_nodes.hpp"
#include "tf2_ros/static_transform_broadcaster.h"
#include "tf2_ros/transform_broadcaster.h"

namespace redag_rclcpp::lab {

using geometry_msgs::msg::PointStamped;
using geometry_msgs::msg::Quaternion;
using geometry_msgs::msg::TransformStamped;
using geometry_msgs::msg::TwistStamped;
using nav_msgs::msg::OccupancyGrid;
using nav_msgs::msg::Odometry;
using redag::Duration;
using sensor_msgs::msg::LaserScan;

namespace {

constexpr double kPi = 3.14159265358979;

Quaternion turned_by(double yaw) {
  Quaternion rotation;
  rotation.z = std::sin(yaw / 2);
  rotation.w = std::cos(yaw / 2);
  return rotation;
}

double yaw_of(const Quaternion &rotation) { return 2 * std::atan2(rotation.z, rotation.w); }

TransformStamped fixed_transform(const std::string &parent, const std::string &child) {
  TransformStamped transform;
  transform.header.frame_id = parent;
  transform.child_frame_id = child;
  transform.transform.rotation.w = 1;
  return transform;
}

}  // namespace

/// Drives as the last message on `cmd_vel` or `behavior_vel` says, for at most `patience` seconds. Publishes `odom` and
/// the transform to `base_link` every `period` seconds. The report is {"commands": [[stamp, arrival, moves], ...],
/// "behavior_commands": as before, "poses": [[stamp, arrival], ...]} with times in nanoseconds of the node's clock.
/// "poses" are those that commands were computed from: the controller tells them on `lookahead_point`, just before each
/// command.
class Base : public rclcpp::Node {
 public:
  explicit Base(const rclcpp::NodeOptions &options)
      : Node("base", options),
        period_(read_seconds(*this, "period", 0.02)),
        patience_(read_seconds(*this, "patience", 0.5)),
        report_(declare_parameter<std::string>("report", "")),
        moved_(now()),
        frames_(*this),
        fixed_frames_(*this),
        odometry_(create_publisher<Odometry>("odom", 10)),
        commands_subscription_(create_subscription<TwistStamped>(
            "cmd_vel", 1, [this](TwistStamped::ConstSharedPtr command) { take(*command, commands_); })),
        behavior_commands_subscription_(create_subscription<TwistStamped>(
            "behavior_vel", 1, [this](TwistStamped::ConstSharedPtr command) { take(*command, behavior_commands_); })),
        poses_subscription_(create_subscription<PointStamped>(
            "lookahead_point", 1,
            [this](PointStamped::ConstSharedPtr point) {
              poses_.emplace_back(rclcpp::Time(point->header.stamp).nanoseconds(), now().nanoseconds());
            })),
        timer_(create_wall_timer(std::chrono::nanoseconds(period_), [this] { tell_pose(); })) {
    // Localisation is perfect, and the lidar is in the middle of the robot.
    fixed_frames_.sendTransform(std::vector{fixed_transform("map", "odom"), fixed_transform("base_link", "laser")});
  }
  Base(const Base &) = delete;
  Base &operator=(const Base &) = delete;

  ~Base() override {
    if (report_.empty()) return;
    const auto listed = [](const std::vector<Command> &commands) {
      nlohmann::json list = nlohmann::json::array();
      for (const Command &command : commands) list.push_back({command.stamp, command.arrival, command.moves});
      return list;
    };
    write_report(
        *this, report_,
        {{"commands", listed(commands_)}, {"behavior_commands", listed(behavior_commands_)}, {"poses", poses_}});
  }

 private:
  struct Command {
    std::int64_t stamp;
    std::int64_t arrival;
    bool moves;
  };

  void take(const TwistStamped &command, std::vector<Command> &commands) {
    move();
    forward_ = command.twist.linear.x;
    turn_ = command.twist.angular.z;
    commanded_ = moved_;
    commands.push_back(
        {rclcpp::Time(command.header.stamp).nanoseconds(), moved_.nanoseconds(), forward_ != 0 || turn_ != 0});
  }

  // Goes on to the pose of this instant.
  void move() {
    const rclcpp::Time time = now();
    if (time - commanded_ > rclcpp::Duration(std::chrono::nanoseconds(patience_))) forward_ = turn_ = 0;
    const double elapsed = (time - moved_).seconds();
    pose_.x += forward_ * elapsed * std::cos(pose_.yaw + turn_ * elapsed / 2);
    pose_.y += forward_ * elapsed * std::sin(pose_.yaw + turn_ * elapsed / 2);
    pose_.yaw = std::remainder(pose_.yaw + turn_ * elapsed, 2 * kPi);
    moved_ = time;
  }

  void tell_pose() {
    move();
    TransformStamped frame = fixed_transform("odom", "base_link");
    frame.header.stamp = moved_;
    frame.transform.translation.x = pose_.x;
    frame.transform.translation.y = pose_.y;
    frame.transform.rotation = turned_by(pose_.yaw);
    frames_.sendTransform(frame);
    Odometry odometry;
    odometry.header = frame.header;
    odometry.child_frame_id = frame.child_frame_id;
    odometry.pose.pose.position.x = pose_.x;
    odometry.pose.pose.position.y = pose_.y;
    odometry.pose.pose.orientation = frame.transform.rotation;
    odometry.twist.twist.linear.x = forward_;
    odometry.twist.twist.angular.z = turn_;
    odometry_->publish(odometry);
  }

  Duration period_;
  Duration patience_;
  std::string report_;
  hall::Pose pose_ = hall::kStart;
  double forward_ = 0;  // m/s
  double turn_ = 0;     // rad/s
  rclcpp::Time moved_;
  rclcpp::Time commanded_ = moved_;
  std::vector<Command> commands_;
  std::vector<Command> behavior_commands_;
  std::vector<std::pair<std::int64_t, std::int64_t>> poses_;
  tf2_ros::TransformBroadcaster frames_;
  tf2_ros::StaticTransformBroadcaster fixed_frames_;
  rclcpp::Publisher<Odometry>::SharedPtr odometry_;
  rclcpp::Subscription<TwistStamped>::SharedPtr commands_subscription_;
  rclcpp::Subscription<TwistStamped>::SharedPtr behavior_commands_subscription_;
  rclcpp::Subscription<PointStamped>::SharedPtr poses_subscription_;
  rclcpp::TimerBase::SharedPtr timer_;
};

/// Publishes `scan` with `rays` rays all round every `period` seconds, as seen from the last message on `odom`, and
/// once the `map` of the hall.
class Lidar : public rclcpp::Node {
 public:
  explicit Lidar(const rclcpp::NodeOptions &options)
      : Node("lidar", options),
        period_(read_seconds(*this, "period", 1.0 / 15)),
        rays_(declare_parameter<int>("rays", 360)),
        scans_(create_publisher<LaserScan>("scan", rclcpp::SensorDataQoS())),
        maps_(create_publisher<OccupancyGrid>("map", rclcpp::QoS(1).transient_local())),
        odometry_(create_subscription<Odometry>(
            "odom", 1, [this](Odometry::ConstSharedPtr odometry) { seen_from_ = std::move(odometry); })),
        timer_(create_wall_timer(std::chrono::nanoseconds(period_), [this] { scan(); })) {
    OccupancyGrid map;
    map.header.frame_id = "map";
    map.header.stamp = now();
    map.info.resolution = static_cast<float>(hall::kResolution);
    map.info.width = static_cast<std::uint32_t>(std::lround(hall::kWidth / hall::kResolution));
    map.info.height = static_cast<std::uint32_t>(std::lround(hall::kHeight / hall::kResolution));
    map.info.origin.orientation.w = 1;
    map.data = hall::draw_map();
    maps_->publish(map);
  }

 private:
  void scan() {
    if (!seen_from_) return;
    const auto &pose = seen_from_->pose.pose;
    LaserScan scan;
    scan.header.stamp = seen_from_->header.stamp;
    scan.header.frame_id = "laser";
    scan.angle_min = static_cast<float>(-kPi);
    scan.angle_increment = static_cast<float>(2 * kPi / static_cast<double>(rays_));
    scan.angle_max = scan.angle_min + static_cast<float>(rays_ - 1) * scan.angle_increment;
    scan.range_min = 0.05F;
    scan.range_max = 12;
    const double yaw = yaw_of(pose.orientation);
    for (std::int64_t i = 0; i < rays_; ++i) {
      const double angle = yaw + scan.angle_min + static_cast<double>(i) * scan.angle_increment;
      scan.ranges.push_back(
          static_cast<float>(hall::cast_ray({pose.position.x, pose.position.y}, angle, scan.range_max)));
    }
    scans_->publish(scan);
  }

  Duration period_;
  std::int64_t rays_;
  Odometry::ConstSharedPtr seen_from_;
  rclcpp::Publisher<LaserScan>::SharedPtr scans_;
  rclcpp::Publisher<OccupancyGrid>::SharedPtr maps_;
  rclcpp::Subscription<Odometry>::SharedPtr odometry_;
  rclcpp::TimerBase::SharedPtr timer_;
};

}  // namespace redag_rclcpp::lab

RCLCPP_COMPONENTS_REGISTER_NODE(redag_rclcpp::lab::Base)
RCLCPP_COMPONENTS_REGISTER_NODE(redag_rclcpp::lab::Lidar)
