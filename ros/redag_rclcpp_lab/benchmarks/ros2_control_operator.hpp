// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The user of the robot in bench_ros2_control: publishes its description, then calls the services of controller_manager
// all the time, and measures how long the answers take.
#pragma once

#include <string>
#include <vector>

#include "controller_manager_msgs/srv/configure_controller.hpp"
#include "controller_manager_msgs/srv/list_controllers.hpp"
#include "controller_manager_msgs/srv/load_controller.hpp"
#include "controller_manager_msgs/srv/switch_controller.hpp"
#include "controller_manager_msgs/srv/unload_controller.hpp"
#include "rclcpp/rclcpp.hpp"
#include "redag/base/time.hpp"
#include "samples.hpp"
#include "stack_comparison.hpp"
#include "std_msgs/msg/string.hpp"

namespace redag_rclcpp::lab {

/// A service of controller_manager, and how long its answers took.
template <class Service>
class TimedClient {
 public:
  TimedClient(rclcpp::Node &node, const std::string &name)
      : client_(node.create_client<Service>("/controller_manager/" + name)) {}

  /// Throws std::runtime_error without an answer. `node`: the one of the constructor.
  typename Service::Response::SharedPtr call(const rclcpp::Node::SharedPtr &node,
                                             const typename Service::Request &request);

  /// Forgets what was measured until now.
  void restart() { latencies_ = {}; }
  [[nodiscard]] const Samples &latencies() const { return latencies_; }

 private:
  typename rclcpp::Client<Service>::SharedPtr client_;
  Samples latencies_;
};

class Operator {
 public:
  explicit Operator(const std::string &robot_description);

  /// Loads the three controllers and activates them. Throws std::runtime_error if that fails.
  void start();

  /// Calls services until `end` on CLOCK_MONOTONIC: lists controllers at 5 Hz, switches the gripper's at 1 Hz, loads
  /// and unloads another one at 0.5 Hz. Measures from here on.
  void run(redag::Time end);

  void report(Figures &figures) const;

 private:
  void load(const std::string &controller);
  bool switch_controllers(const std::vector<std::string> &activate, const std::vector<std::string> &deactivate);

  rclcpp::Node::SharedPtr node_;
  rclcpp::Publisher<std_msgs::msg::String>::SharedPtr description_;
  TimedClient<controller_manager_msgs::srv::ListControllers> list_;
  TimedClient<controller_manager_msgs::srv::LoadController> load_;
  TimedClient<controller_manager_msgs::srv::ConfigureController> configure_;
  TimedClient<controller_manager_msgs::srv::SwitchController> switch_;
  TimedClient<controller_manager_msgs::srv::UnloadController> unload_;
  int failed_ = 0;
};

}  // namespace redag_rclcpp::lab
