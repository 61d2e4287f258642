// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Runs Nav2's servers (github.com/ros-navigation/navigation2) in rclcpp's component containers and in redag_rclcpp's. A
// synthetic robot drives through a hall, and a control loop of 500 Hz runs beside them in the same process. Measures
// how late the control loop is called, how regular the robot's commands and the ticks of its behaviour tree are, how
// old poses and scans are when they are used, how late goals are accepted, and processor time. Containers take turns.
// Built if the package nav2_controller is present.
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <fstream>
#include <nlohmann/json.hpp>
#include <optional>
#include <stdexcept>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "command_line.hpp"
#include "component_containers.hpp"
#include "nav2_user.hpp"
#include "rclcpp/rclcpp.hpp"
#include "redag/threads/clock.hpp"
#include "samples.hpp"
#include "stack_comparison.hpp"

namespace {

using redag::Time;
using redag::runtime::monotonic_now;
using redag_rclcpp::lab::Component;
using redag_rclcpp::lab::Container;
using redag_rclcpp::lab::Figures;
using redag_rclcpp::lab::NavigationServers;
using redag_rclcpp::lab::read_report;
using redag_rclcpp::lab::Samples;
using redag_rclcpp::lab::StackOptions;
using redag_rclcpp::lab::StackRun;

constexpr double kWarmUp = 2;    // seconds between Nav2's start and what is measured
constexpr double kUpdates = 10;  // updates of the local costmap a second
constexpr double kCycles = 10;   // cycles of a behaviour a second
constexpr int kTick = 10;        // ms from tick to tick of the behaviour tree

constexpr const char *kDescription = "Compares component containers on the servers of Nav2.\n";

constexpr const char *kExplanation =
    R"(Examples:
  ros2 run redag_rclcpp_lab bench_nav2 --rounds 3 --seconds 20
  ros2 run redag_rclcpp_lab bench_nav2 --only isolated,redag-os --controller 50
  ros2 run redag_rclcpp_lab bench_nav2 --no-navigator --no-behaviors

The figures are medians over the runs. Exit status: 0 success; 1 a container did
not run to its end, or Nav2 did not become active; 2 invalid options.)";

/// What the components have as options.
struct Setting {
  double controller = 20;
  double scans = 15;
  double control = 500;
  NavigationServers servers;
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

nlohmann::json controller_parameters(const Setting &setting) {
  return {{"controller_frequency", setting.controller},
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

nlohmann::json behavior_parameters() {
  return {{"cycle_frequency", kCycles}, {"enable_stamped_cmd_vel", true}, {"simulate_ahead_time", 2.0},
          {"max_rotational_vel", 1.0},  {"min_rotational_vel", 0.4},      {"rotational_acc_lim", 3.2}};
}

nlohmann::json navigator_parameters() {
  return {{"navigators", {"navigate_to_pose"}},
          {"navigate_to_pose", {{"plugin", "nav2_bt_navigator::NavigateToPoseNavigator"}}},
          {"bt_loop_duration", kTick},
          {"default_server_timeout", 20},
          {"wait_for_service_timeout", 1000},
          {"error_code_names", {"compute_path_error_code", "follow_path_error_code"}}};
}

nlohmann::json manager_parameters(const NavigationServers &servers) {
  std::vector<std::string> names = {"controller_server", "planner_server"};
  if (servers.behaviors) names.emplace_back("behavior_server");
  if (servers.navigator) names.emplace_back("bt_navigator");
  return {{"autostart", true}, {"node_names", names}};
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
    } else if (value.is_number_integer()) {
      all.emplace_back(name, value.get<std::int64_t>());
    } else {
      all.emplace_back(name, value.get<double>());
    }
  }
  return all;
}

std::vector<Component> robot(const Setting &setting, const std::string &folder) {
  const std::string own = "redag_rclcpp_lab";
  std::vector<Component> all = {
      {own, "redag_rclcpp::lab::Base", {}, {rclcpp::Parameter("report", folder + "/base")}},
      {own, "redag_rclcpp::lab::Lidar", {}, {rclcpp::Parameter("period", 1 / setting.scans)}},
      {"nav2_controller", "nav2_controller::ControllerServer", {}, flat(controller_parameters(setting))},
      {"nav2_planner", "nav2_planner::PlannerServer", {}, flat(planner_parameters())}};
  if (setting.servers.behaviors) {
    all.push_back({"nav2_behaviors",
                   "behavior_server::BehaviorServer",
                   {"cmd_vel:=behavior_vel"},  // the base tells these commands from the controller's
                   flat(behavior_parameters())});
  }
  if (setting.servers.navigator) {
    all.push_back({"nav2_bt_navigator", "nav2_bt_navigator::BtNavigator", {}, flat(navigator_parameters())});
  }
  all.push_back({"nav2_lifecycle_manager",
                 "nav2_lifecycle_manager::LifecycleManager",
                 {},
                 flat(manager_parameters(setting.servers))});
  return all;
}

/// What the base noted of commands that come `rate` times a second, from `begin` to `end` on the system's clock. False
/// if there were none.
bool report_commands(Figures &figures, const std::string &name, const nlohmann::json &commands, Time begin, Time end,
                     double rate) {
  const double period = static_cast<double>(redag::kSecond) / rate;
  Samples off;
  Samples transit;
  double missed = 0;
  std::optional<Time> last;  // of a command after which the robot goes on
  for (const std::tuple<Time, Time, bool> command : commands) {
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
  if (off.size() == 0) return false;
  figures[name + "s missed, %"] = 100 * missed / (missed + static_cast<double>(off.size()));
  add_samples(figures, name + " interval off", off);
  add_samples(figures, name + " to base", transit);
  return true;
}

void report_base(Figures &figures, const nlohmann::json &base, Time begin, Time end, const Setting &setting) {
  if (!report_commands(figures, "command", base.at("commands"), begin, end, setting.controller)) {
    throw std::runtime_error("the base got no commands");
  }
  if (setting.servers.behaviors) {
    (void)report_commands(figures, "behavior command", base.at("behavior_commands"), begin, end, kCycles);
  }
  Samples ages;
  for (const std::pair<Time, Time> pose : base.at("poses")) {
    if (begin <= pose.second && pose.second < end) ages.add(pose.second - pose.first);
  }
  add_samples(figures, "pose to command", ages);
}

Figures measure(const StackRun &run, const StackOptions &options, const Setting &setting) {
  const std::string parameters = run.folder + "/parameters.yaml";
  write_costmap_parameters(parameters);
  Figures figures;
  Container container(run, options, parameters);
  const Time start = monotonic_now();
  container.load(robot(setting, run.folder));
  Time begin = 0;
  Time end = 0;
  {
    redag_rclcpp::lab::NavigationUser user(setting.servers);
    user.await_active();
    figures["active after, s"] = static_cast<double>(monotonic_now() - start) / redag::kSecond;
    container.load({redag_rclcpp::lab::control_loop(run, setting.control, kWarmUp, options.seconds)});
    const auto in_seconds = [](double seconds) { return std::llround(seconds * static_cast<double>(redag::kSecond)); };
    const Time now = monotonic_now();
    const Time to_system_clock = rclcpp::Clock(RCL_SYSTEM_TIME).now().nanoseconds() - now;
    begin = now + in_seconds(kWarmUp);
    end = begin + in_seconds(options.seconds);
    user.drive(begin, end);
    user.report(figures, {kUpdates, 1000.0 / kTick});
    begin += to_system_clock;
    end += to_system_clock;
  }
  figures["processors used"] = container.end();
  add_control(figures, run);
  report_base(figures, read_report(run.folder + "/base"), begin, end, setting);
  return figures;
}

}  // namespace

int main(int argc, char **argv) {
  Setting setting;
  redag_rclcpp::lab::StackComparison comparison;
  comparison.program = "bench_nav2";
  comparison.description = kDescription;
  comparison.explanation = kExplanation;
  comparison.config = "nav2.yaml";
  comparison.add_options = [&](CLI::App &app) {
    using redag_rclcpp::lab::add_number;
    add_number<double>(app, "--controller", setting.controller, 0.001, "Commands of Nav2's controller a second");
    add_number<double>(app, "--scans", setting.scans, 0.001, "Scans of the lidar a second");
    add_number<double>(app, "--control", setting.control, 0.001, "Calls of the control loop a second, of 0.3 ms each");
    CLI::Option *no_navigator =
        app.add_flag("!--no-navigator", setting.servers.navigator, "Without bt_navigator: the user of the robot plans");
    app.add_flag("!--no-behaviors", setting.servers.behaviors, "Without behavior_server, which bt_navigator needs")
        ->needs(no_navigator);
  };
  comparison.measure = [&](const StackRun &run, const StackOptions &options) { return measure(run, options, setting); };
  return redag_rclcpp::lab::run_containers(std::move(comparison), argc, argv);
}
