// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "ros2_control_operator.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <memory>
#include <stdexcept>
#include <thread>

#include "redag/threads/clock.hpp"

namespace redag_rclcpp::lab {

using controller_manager_msgs::srv::ConfigureController;
using controller_manager_msgs::srv::ListControllers;
using controller_manager_msgs::srv::LoadController;
using controller_manager_msgs::srv::SwitchController;
using controller_manager_msgs::srv::UnloadController;
using redag::runtime::monotonic_now;

namespace {

constexpr std::chrono::seconds kLimit(30);  // of an answer
constexpr redag::Duration kCallPeriod = 200 * redag::kMillisecond;
const std::vector<std::string> kControllers = {"joint_state_broadcaster", "arm_controller", "gripper_controller"};

}  // namespace

template <class Service>
typename Service::Response::SharedPtr TimedClient<Service>::call(const rclcpp::Node::SharedPtr &node,
                                                                 const typename Service::Request &request) {
  if (!client_->wait_for_service(kLimit)) {
    throw std::runtime_error(fmt::format("{} is not offered", client_->get_service_name()));
  }
  const redag::Time sent = monotonic_now();
  auto future = client_->async_send_request(std::make_shared<typename Service::Request>(request));
  if (rclcpp::spin_until_future_complete(node, future, kLimit) != rclcpp::FutureReturnCode::SUCCESS) {
    throw std::runtime_error(fmt::format("no answer from {}", client_->get_service_name()));
  }
  latencies_.add(monotonic_now() - sent);
  return future.get();
}

Operator::Operator(const std::string &robot_description)
    : node_(std::make_shared<rclcpp::Node>("bench_ros2_control")),
      description_(
          node_->create_publisher<std_msgs::msg::String>("robot_description", rclcpp::QoS(1).transient_local())),
      list_(*node_, "list_controllers"),
      load_(*node_, "load_controller"),
      configure_(*node_, "configure_controller"),
      switch_(*node_, "switch_controller"),
      unload_(*node_, "unload_controller") {
  std_msgs::msg::String message;
  message.data = robot_description;
  description_->publish(message);
}

void Operator::start() {
  for (const std::string &controller : kControllers) load(controller);
  if (!switch_controllers(kControllers, {})) throw std::runtime_error("the controllers cannot be activated");
}

void Operator::run(redag::Time end) {
  list_.restart();
  load_.restart();
  switch_.restart();
  failed_ = 0;
  const std::vector<std::string> gripper = {"gripper_controller"};
  bool active = true;
  redag::Time next = monotonic_now();
  for (int call = 0; next < end; ++call) {
    (void)list_.call(node_, ListControllers::Request());
    if (call % 5 == 2) {
      if (active ? switch_controllers({}, gripper) : switch_controllers(gripper, {})) {
        active = !active;
      } else {
        ++failed_;
      }
    }
    if (call % 10 == 4) {
      load("spare_controller");
      UnloadController::Request request;
      request.name = "spare_controller";
      if (!unload_.call(node_, request)->ok) throw std::runtime_error("spare_controller cannot be unloaded");
    }
    next = std::max(next + kCallPeriod, monotonic_now());
    std::this_thread::sleep_for(std::chrono::nanoseconds(std::min(next, end) - monotonic_now()));
  }
}

void Operator::report(Figures &figures) const {
  add_samples(figures, "list answers", list_.latencies());
  add_samples(figures, "load answers", load_.latencies());
  add_samples(figures, "switch answers", switch_.latencies());
  figures["switches failed"] = failed_;
}

void Operator::load(const std::string &controller) {
  LoadController::Request load;
  load.name = controller;
  if (!load_.call(node_, load)->ok) throw std::runtime_error(controller + " cannot be loaded");
  ConfigureController::Request configure;
  configure.name = controller;
  if (!configure_.call(node_, configure)->ok) throw std::runtime_error(controller + " cannot be configured");
}

/// With the settings of controller_manager's own spawner. Returns false if they could not be switched.
bool Operator::switch_controllers(const std::vector<std::string> &activate,
                                  const std::vector<std::string> &deactivate) {
  SwitchController::Request request;
  request.activate_controllers = activate;
  request.deactivate_controllers = deactivate;
  request.strictness = SwitchController::Request::STRICT;
  request.activate_asap = true;
  request.timeout = rclcpp::Duration(std::chrono::seconds(5));
  return switch_.call(node_, request)->ok;
}

}  // namespace redag_rclcpp::lab
