// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "ros2_control_robot.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <controller_manager/controller_manager.hpp>
#include <fstream>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <sensor_msgs/msg/joint_state.hpp>
#include <std_msgs/msg/float64.hpp>
#include <thread>
#include <utility>
#include <vector>

#include "peers.hpp"
#include "rclcpp/rclcpp.hpp"
#include "redag/base/time.hpp"
#include "redag/threads/clock.hpp"
#include "redag_rclcpp/executor.hpp"
#include "redag_rclcpp/monitor.hpp"
#include "redag_rclcpp/options.hpp"
#include "timer_grid.hpp"

namespace redag_rclcpp::lab {

namespace {

using controller_manager::ControllerManager;
using redag::runtime::monotonic_now;
using sensor_msgs::msg::JointState;
using std_msgs::msg::Float64;

constexpr std::chrono::milliseconds kPlannerPeriod(100);

/// Calls the control loop of controller_manager from a timer, where ros2_control_node has a thread for it.
class UpdateLoop : public rclcpp::Node {
 public:
  explicit UpdateLoop(std::shared_ptr<ControllerManager> manager)
      : Node("update_loop"),
        manager_(std::move(manager)),
        last_(manager_->get_trigger_clock()->now()),
        timer_(create_wall_timer(std::chrono::nanoseconds(redag::kSecond / manager_->get_update_rate()),
                                 [this] { update(); })) {}

 private:
  void update() {
    const rclcpp::Time now = manager_->get_trigger_clock()->now();
    const rclcpp::Duration period = now - last_;
    last_ = now;
    manager_->read(now, period);
    manager_->update(now, period);
    manager_->write(now, period);
  }

  std::shared_ptr<ControllerManager> manager_;
  rclcpp::Time last_;
  rclcpp::TimerBase::SharedPtr timer_;
};

/// Takes the joints' states, computes for `load` seconds at 10 Hz, and then publishes commands. Notes its calls in the
/// file `report`: {"plans": [[point of the timer's grid, end], ...], "states": number} in nanoseconds.
class Planner : public rclcpp::Node {
 public:
  Planner()
      : Node("planner"),
        load_(std::llround(declare_parameter<double>("load", 0.03) * static_cast<double>(redag::kSecond))),
        report_(declare_parameter<std::string>("report", "")),
        grid_(std::chrono::nanoseconds(kPlannerPeriod).count()),
        commands_(create_publisher<Float64>("arm_controller/command", 10)),
        states_(create_subscription<JointState>("joint_states", 10,
                                                [this](JointState::ConstSharedPtr) { ++states_seen_; })),
        timer_(create_wall_timer(kPlannerPeriod, [this] { plan(); })) {}
  Planner(const Planner &) = delete;
  Planner &operator=(const Planner &) = delete;

  ~Planner() override {
    if (report_.empty()) return;
    std::ofstream out(report_);
    out << nlohmann::json{{"plans", plans_}, {"states", states_seen_}} << "\n";
    if (!out.flush()) RCLCPP_ERROR(get_logger(), "cannot write the parameter report's file '%s'", report_.c_str());
  }

 private:
  void plan() {
    const TimerCall call = grid_.next(*timer_);
    use_processor(load_);
    Float64 command;
    command.data = static_cast<double>(monotonic_now()) / static_cast<double>(redag::kSecond);
    commands_->publish(command);
    plans_.emplace_back(call.nominal, monotonic_now());
  }

  redag::Duration load_;
  std::string report_;
  TimerGrid grid_;
  std::vector<std::pair<redag::Time, redag::Time>> plans_;
  std::int64_t states_seen_ = 0;
  rclcpp::Publisher<Float64>::SharedPtr commands_;
  rclcpp::Subscription<JointState>::SharedPtr states_;
  rclcpp::TimerBase::SharedPtr timer_;
};

/// As ros2_control_node makes it: the arguments for ROS are handed on to the controllers.
std::shared_ptr<ControllerManager> make_manager(const std::shared_ptr<rclcpp::Executor> &executor, int argc,
                                                char **argv) {
  const std::vector<std::string> arguments(argv + 1, argv + argc);
  rclcpp::NodeOptions options = controller_manager::get_cm_node_options();
  options.arguments({std::find(arguments.begin(), arguments.end(), "--ros-args"), arguments.end()});
  return std::make_shared<ControllerManager>(executor, "controller_manager", "", options);
}

}  // namespace

int run_robot(const std::string &executor_name, int argc, char **argv) {
  rclcpp::init(argc, argv);
  const auto robot = std::make_shared<rclcpp::Node>("robot");
  std::shared_ptr<rclcpp::Executor> executor;
  std::optional<Monitor> monitor;
  if (executor_name == "redag") {
    const ReDAGOptions options = declare_options(*robot);
    const MonitorOptions monitored = declare_monitor_options(*robot, options);
    const auto redag_executor = std::make_shared<ReDAGExecutor>(options);
    monitor.emplace(robot, *redag_executor, monitored);
    executor = redag_executor;
  } else {
    executor = make_peer(executor_name, std::max(2U, std::thread::hardware_concurrency()));
  }
  const auto manager = make_manager(executor, argc, argv);
  const auto update_loop = std::make_shared<UpdateLoop>(manager);
  const auto planner = std::make_shared<Planner>();
  for (const rclcpp::Node::SharedPtr &node :
       {robot, std::static_pointer_cast<rclcpp::Node>(manager), std::static_pointer_cast<rclcpp::Node>(update_loop),
        std::static_pointer_cast<rclcpp::Node>(planner)}) {
    executor->add_node(node);
  }
  executor->spin();
  rclcpp::shutdown();
  return 0;
}

int run_planner(int argc, char **argv) {
  rclcpp::init(argc, argv);
  rclcpp::spin(std::make_shared<Planner>());
  rclcpp::shutdown();
  return 0;
}

}  // namespace redag_rclcpp::lab
