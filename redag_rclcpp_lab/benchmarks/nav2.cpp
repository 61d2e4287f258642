// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Runs Nav2's servers (github.com/ros-navigation/navigation2) in rclcpp's component containers and in redag_rclcpp's. A
// synthetic robot drives through a hall, and a control loop of 500 Hz runs beside them in the same process. Measures
// how late the control loop is called, how regular the robot's commands are and how old, how long plans take, and
// processor time. Containers take turns. Built if the package nav2_controller is present.
#include <fmt/format.h>

#include <algorithm>
#include <ament_index_cpp/get_package_share_directory.hpp>
#include <cmath>
#include <cstdint>
#include <fstream>
#include <nlohmann/json.hpp>
#include <optional>
#include <stdexcept>
#include <string>
#include <tuple>
#include <vector>

#include "command_line.hpp"
#include "component_containers.hpp"
#include "nav2_user.hpp"
#include "rclcpp/rclcpp.hpp"
#include "redag/runtime/clock.hpp"
#include "samples.hpp"
#include "stack_comparison.hpp"

namespace {

using redag::Time;
using redag::runtime::monotonic_now;
using redag_rclcpp::lab::Component;
using redag_rclcpp::lab::Container;
using redag_rclcpp::lab::Figures;
using redag_rclcpp::lab::read_report;
using redag_rclcpp::lab::Samples;
using redag_rclcpp::lab::StackOptions;
using redag_rclcpp::lab::StackRun;

constexpr double kWarmUp = 2;    // seconds between Nav2's start and what is measured
constexpr double kUpdates = 10;  // updates of the local costmap a second

constexpr const char *kDescription = "Compares component containers on the servers of Nav2.\n";

constexpr const char *kExplanation =
    R"(Examples:
  ros2 run redag_rclcpp_lab bench_nav2 --rounds 3 --seconds 20
  ros2 run redag_rclcpp_lab bench_nav2 --only isolated,redag-os --controller 50

The figures are medians over the runs. Exit status: 0 success; 1 a container did
not run to its end, or Nav2 did not become active; 2 invalid options.)";

/// What the components have as options.
struct Rates {
  double controller = 20;
  double scans = 15;
  double control = 500;
};

nlohmann::json inflation() {
  return {{"plugin", "nav2_costmap_2d::InflationLayer"}, {"cost_scaling_factor", 3.0}, {"inflation_radius", 0.7}};
}

nlohmann::json obstacles(const char *plugin) {
  return {{"plugin", plugin},
          {"observation_sources", "scan"},
          {"scan",
           {{"topic", "/scan"},
            {"data_type", "LaserScan"},
            {"max_obstacle_height", 2.0},
            {"clearing", true},
            {"marking", true}}}};
}

// The parameters are those of nav2_bringup where there is no reason for others.

nlohmann::json controller_parameters(const Rates &rates) {
  return {{"controller_frequency", rates.controller},
          {"enable_stamped_cmd_vel", true},
          {"failure_tolerance", 0.3},
          {"progress_checker_plugins", {"progress_checker"}},
          {"goal_checker_plugins", {"goal_checker"}},
          {"controller_plugins", {"FollowPath"}},
          {"progress_checker",
           {{"plugin", "nav2_controller::SimpleProgressChecker"},
            {"required_movement_radius", 0.5},
            {"movement_time_allowance", 10.0}}},
          {"goal_checker",
           {{"plugin", "nav2_controller::SimpleGoalChecker"}, {"xy_goal_tolerance", 0.4}, {"yaw_goal_tolerance", 6.3}}},
          {"FollowPath",
           {{"plugin", "nav2_regulated_pure_pursuit_controller::RegulatedPurePursuitController"},
            {"desired_linear_vel", 1.5},
            {"lookahead_dist", 0.9},
            {"use_cost_regulated_linear_velocity_scaling", false}}}};
}

nlohmann::json planner_parameters() {
  return {{"expected_planner_frequency", 0.0},
          {"planner_plugins", {"GridBased"}},
          {"GridBased", {{"plugin", "nav2_navfn_planner::NavfnPlanner"}, {"tolerance", 0.5}}}};
}

nlohmann::json manager_parameters() {
  return {{"autostart", true}, {"node_names", {"controller_server", "planner_server"}}};
}

nlohmann::json local_costmap_parameters() {
  nlohmann::json voxels = obstacles("nav2_costmap_2d::VoxelLayer");
  voxels.update({{"publish_voxel_map", false}, {"origin_z", 0.0}, {"z_resolution", 0.05}, {"z_voxels", 16}});
  return {{"update_frequency", kUpdates},
          {"publish_frequency", 2 * kUpdates},  // each update is published
          {"global_frame", "odom"},
          {"rolling_window", true},
          {"width", 4},
          {"height", 4},
          {"resolution", 0.05},
          {"robot_radius", 0.22},
          {"always_send_full_costmap", true},
          {"plugins", {"voxel_layer", "inflation_layer"}},
          {"voxel_layer", voxels},
          {"inflation_layer", inflation()}};
}

nlohmann::json global_costmap_parameters() {
  return {{"update_frequency", 1.0},
          {"publish_frequency", 1.0},
          {"global_frame", "map"},
          {"robot_radius", 0.22},
          {"resolution", 0.05},
          {"track_unknown_space", true},
          {"plugins", {"static_layer", "obstacle_layer", "inflation_layer"}},
          {"static_layer", {{"plugin", "nav2_costmap_2d::StaticLayer"}, {"map_subscribe_transient_local", true}}},
          {"obstacle_layer", obstacles("nav2_costmap_2d::ObstacleLayer")},
          {"inflation_layer", inflation()}};
}

/// The servers make the nodes of their costmaps themselves. These nodes take parameters from the process alone.
void write_costmap_parameters(const std::string &file) {
  nlohmann::json nodes;
  nodes["local_costmap"]["local_costmap"]["ros__parameters"] = local_costmap_parameters();
  nodes["global_costmap"]["global_costmap"]["ros__parameters"] = global_costmap_parameters();
  std::ofstream(file) << nodes << "\n";  // YAML contains JSON
}

/// A component takes its parameters from the request that loads it: those of inner objects as NAME.INNER.
std::vector<rclcpp::Parameter> flat(const nlohmann::json &parameters, const std::string &prefix = "") {
  std::vector<rclcpp::Parameter> all;
  for (const auto &[key, value] : parameters.items()) {
    const std::string name = prefix + key;
    if (value.is_object()) {
      for (const rclcpp::Parameter &inner : flat(value, name + ".")) all.push_back(inner);
    } else if (value.is_array()) {
      all.emplace_back(name, value.get<std::vector<std::string>>());
    } else if (value.is_boolean()) {
      all.emplace_back(name, value.get<bool>());
    } else if (value.is_string()) {
      all.emplace_back(name, value.get<std::string>());
    } else {
      all.emplace_back(name, value.get<double>());
    }
  }
  return all;
}

std::vector<Component> robot(const Rates &rates, const std::string &folder) {
  const std::string own = "redag_rclcpp_lab";
  return {{own, "redag_rclcpp::lab::Base", {}, {rclcpp::Parameter("report", folder + "/base")}},
          {own, "redag_rclcpp::lab::Lidar", {}, {rclcpp::Parameter("period", 1 / rates.scans)}},
          {"nav2_controller", "nav2_controller::ControllerServer", {}, flat(controller_parameters(rates))},
          {"nav2_planner", "nav2_planner::PlannerServer", {}, flat(planner_parameters())},
          {"nav2_lifecycle_manager", "nav2_lifecycle_manager::LifecycleManager", {}, flat(manager_parameters())}};
}

Component control(const Rates &rates, const StackOptions &options, const std::string &folder) {
  return {"redag_rclcpp_lab",
          "redag_rclcpp::lab::Control",
          {},
          {rclcpp::Parameter("period", 1 / rates.control), rclcpp::Parameter("warm_up", kWarmUp),
           rclcpp::Parameter("seconds", options.seconds), rclcpp::Parameter("report", folder + "/control")}};
}

/// What the base noted from `begin` to `end`, on the system's clock.
void report_commands(Figures &figures, const nlohmann::json &base, Time begin, Time end, double rate) {
  const double period = static_cast<double>(redag::kSecond) / rate;
  Samples off;
  Samples transit;
  double missed = 0;
  std::optional<Time> last;  // of a command after which the controller goes on
  for (const std::tuple<Time, Time, bool> command : base.at("commands")) {
    const auto [stamp, arrival, moves] = command;
    if (stamp < begin || stamp >= end) continue;
    transit.add(arrival - stamp);
    if (last) {
      const auto interval = static_cast<double>(stamp - *last);
      off.add(std::llround(std::abs(interval - period)));
      missed += std::max(0.0, std::round(interval / period) - 1);
    }
    last = moves ? std::optional(stamp) : std::nullopt;
  }
  if (off.size() == 0) throw std::runtime_error("the base got no commands");
  figures["commands missed, %"] = 100 * missed / (missed + static_cast<double>(off.size()));
  add_samples(figures, "command interval off", off);
  add_samples(figures, "command to base", transit);
  Samples ages;
  for (const std::pair<Time, Time> pose : base.at("poses")) {
    if (begin <= pose.second && pose.second < end) ages.add(pose.second - pose.first);
  }
  add_samples(figures, "pose to command", ages);
}

Figures measure(const StackRun &run, const StackOptions &options, const Rates &rates) {
  const std::string parameters = run.folder + "/parameters.yaml";
  write_costmap_parameters(parameters);
  Figures figures;
  Container container(run, options, parameters);
  const Time start = monotonic_now();
  container.load(robot(rates, run.folder));
  Time begin = 0;
  Time end = 0;
  {
    redag_rclcpp::lab::NavigationUser user;
    user.await_active();
    figures["active after, s"] = static_cast<double>(monotonic_now() - start) / redag::kSecond;
    container.load({control(rates, options, run.folder)});
    const auto in_seconds = [](double seconds) { return std::llround(seconds * static_cast<double>(redag::kSecond)); };
    const Time now = monotonic_now();
    const Time to_system_clock = rclcpp::Clock(RCL_SYSTEM_TIME).now().nanoseconds() - now;
    begin = now + in_seconds(kWarmUp);
    end = begin + in_seconds(options.seconds);
    user.drive(begin, end);
    user.report(figures, kUpdates);
    begin += to_system_clock;
    end += to_system_clock;
  }
  figures["processors used"] = container.end();
  const nlohmann::json control = read_report(run.folder + "/control");
  figures["control missed, %"] =
      100 * control.at("missed").get<double>() / std::max(1.0, control.at("points").get<double>());
  for (const auto &[rank, value] : control.at("lateness").items()) {
    if (rank != "max") figures["control late, ms, " + rank] = value;
  }
  report_commands(figures, read_report(run.folder + "/base"), begin, end, rates.controller);
  return figures;
}

}  // namespace

int main(int argc, char **argv) {
  if (const std::optional<int> status = redag_rclcpp::lab::run_own_container(argc, argv)) return *status;
  rclcpp::init(0, nullptr);
  Rates rates;
  redag_rclcpp::lab::StackComparison comparison;
  comparison.program = "bench_nav2";
  comparison.description = kDescription;
  comparison.explanation = fmt::format("{}\n\n{}", redag_rclcpp::lab::kContainersExplained, kExplanation);
  comparison.config = ament_index_cpp::get_package_share_directory("redag_rclcpp") + "/config/stacks/nav2.yaml";
  comparison.add_options = [&](CLI::App &app) {
    using redag_rclcpp::lab::add_number;
    add_number<double>(app, "--controller", rates.controller, 0.001, "Commands of Nav2's controller a second");
    add_number<double>(app, "--scans", rates.scans, 0.001, "Scans of the lidar a second");
    add_number<double>(app, "--control", rates.control, 0.001, "Calls of the control loop a second, of 0.3 ms each");
  };
  comparison.contenders = redag_rclcpp::lab::container_names();
  comparison.measure = [&](const StackRun &run, const StackOptions &options) { return measure(run, options, rates); };
  const int status = run_comparison(comparison, argc, argv);
  rclcpp::shutdown();
  return status;
}
