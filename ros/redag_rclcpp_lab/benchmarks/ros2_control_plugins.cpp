// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Plugins of bench_ros2_control for controller_manager. The hardware has joints whose positions follow their commands
// at once. It notes when it is read, and when a new command reaches it. The controller forwards commands from a topic.
// A command is the time at which it was published, in seconds of CLOCK_MONOTONIC.
#include <atomic>
#include <cmath>
#include <cstdint>
#include <fstream>
#include <limits>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>
#include <vector>

#include "controller_interface/controller_interface.hpp"
#include "hardware_interface/system_interface.hpp"
#include "pluginlib/class_list_macros.hpp"
#include "redag/base/time.hpp"
#include "redag/threads/clock.hpp"
#include "std_msgs/msg/float64.hpp"
#include "timer_grid.hpp"

namespace redag_rclcpp::lab {

using hardware_interface::CallbackReturn;
using redag::runtime::monotonic_now;

/// Parameters in the URDF: `load`, the processor time in seconds that a read takes, and `report`, the file for what was
/// noted, written at the end: {"reads": [time, ...], "commands": [[time, age], ...]} in nanoseconds.
class Plant : public hardware_interface::SystemInterface {
 public:
  CallbackReturn on_init(const hardware_interface::HardwareComponentInterfaceParams &params) override {
    if (SystemInterface::on_init(params) != CallbackReturn::SUCCESS) return CallbackReturn::ERROR;
    const auto &parameters = get_hardware_info().hardware_parameters;
    report_ = parameters.at("report");
    load_ = std::llround(std::stod(parameters.at("load")) * static_cast<double>(redag::kSecond));
    // Growing them later would take time from the control loop.
    reads_.reserve(1'000'000);
    commands_.reserve(100'000);
    return CallbackReturn::SUCCESS;
  }

  /// controller_manager calls it at its end, and reads no more.
  CallbackReturn on_shutdown(const rclcpp_lifecycle::State & /*previous*/) override {
    std::ofstream out(report_);
    out << nlohmann::json{{"reads", reads_}, {"commands", commands_}} << "\n";
    if (out.flush()) return CallbackReturn::SUCCESS;
    RCLCPP_ERROR(get_logger(), "cannot write the parameter report's file '%s'", report_.c_str());
    return CallbackReturn::ERROR;
  }

  hardware_interface::return_type read(const rclcpp::Time & /*time*/, const rclcpp::Duration & /*period*/) override {
    reads_.push_back(monotonic_now());
    use_processor(load_);
    for (const auto &joint : get_hardware_info().joints) {
      const double command = get_command<double>(joint.name + "/position");
      if (std::isfinite(command)) set_state(joint.name + "/position", command);
    }
    return hardware_interface::return_type::OK;
  }

  hardware_interface::return_type write(const rclcpp::Time & /*time*/, const rclcpp::Duration & /*period*/) override {
    const double command = get_command<double>(get_hardware_info().joints.front().name + "/position");
    if (std::isfinite(command) && command != last_command_) {
      last_command_ = command;
      const redag::Time now = monotonic_now();
      commands_.emplace_back(now, now - std::llround(command * static_cast<double>(redag::kSecond)));
    }
    return hardware_interface::return_type::OK;
  }

 private:
  std::string report_;
  redag::Duration load_ = 0;
  double last_command_ = 0;
  std::vector<redag::Time> reads_;
  std::vector<std::pair<redag::Time, redag::Duration>> commands_;
};

/// Commands all its `joints` to the last position that came on `~/command`.
class Forward : public controller_interface::ControllerInterface {
 public:
  controller_interface::CallbackReturn on_init() override {
    auto_declare<std::vector<std::string>>("joints", {});
    return controller_interface::CallbackReturn::SUCCESS;
  }

  controller_interface::InterfaceConfiguration command_interface_configuration() const override {
    controller_interface::InterfaceConfiguration positions;
    positions.type = controller_interface::interface_configuration_type::INDIVIDUAL;
    for (const std::string &joint : joints_) positions.names.push_back(joint + "/position");
    return positions;
  }

  controller_interface::InterfaceConfiguration state_interface_configuration() const override {
    return {controller_interface::interface_configuration_type::NONE, {}};
  }

  controller_interface::CallbackReturn on_configure(const rclcpp_lifecycle::State & /*previous*/) override {
    joints_ = get_node()->get_parameter("joints").as_string_array();
    commands_ = get_node()->create_subscription<std_msgs::msg::Float64>(
        "~/command", 10, [this](const std_msgs::msg::Float64 &message) { command_ = message.data; });
    return controller_interface::CallbackReturn::SUCCESS;
  }

  controller_interface::CallbackReturn on_activate(const rclcpp_lifecycle::State & /*previous*/) override {
    command_ = std::numeric_limits<double>::quiet_NaN();
    return controller_interface::CallbackReturn::SUCCESS;
  }

  controller_interface::return_type update(const rclcpp::Time & /*time*/,
                                           const rclcpp::Duration & /*period*/) override {
    const double command = command_;
    if (!std::isfinite(command)) return controller_interface::return_type::OK;
    bool all_set = true;
    for (auto &joint : command_interfaces_) all_set = joint.set_value(command) && all_set;
    return all_set ? controller_interface::return_type::OK : controller_interface::return_type::ERROR;
  }

 private:
  std::vector<std::string> joints_;
  std::atomic<double> command_{std::numeric_limits<double>::quiet_NaN()};
  rclcpp::Subscription<std_msgs::msg::Float64>::SharedPtr commands_;
};

}  // namespace redag_rclcpp::lab

PLUGINLIB_EXPORT_CLASS(redag_rclcpp::lab::Plant, hardware_interface::SystemInterface)
PLUGINLIB_EXPORT_CLASS(redag_rclcpp::lab::Forward, controller_interface::ControllerInterface)
