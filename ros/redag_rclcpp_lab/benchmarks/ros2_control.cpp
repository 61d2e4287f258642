// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Runs controller_manager (github.com/ros-controls/ros2_control) with its update loop as a timer of an executor, beside
// a planner, and with ros2_control_node's own thread. Services load and switch controllers meanwhile. Measures how
// regular the update loop is, how long commands take to the hardware and services to answer, and processor time.
// Contenders take turns. Built if the package controller_manager is present.
#include <fmt/format.h>

#include <algorithm>
#include <ament_index_cpp/get_package_prefix.hpp>
#include <ament_index_cpp/get_package_share_directory.hpp>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "child_process.hpp"
#include "command_line.hpp"
#include "peers.hpp"
#include "rclcpp/rclcpp.hpp"
#include "redag/threads/clock.hpp"
#include "redag/threads/setup.hpp"
#include "ros2_control_operator.hpp"
#include "ros2_control_robot.hpp"
#include "samples.hpp"
#include "stack_comparison.hpp"

namespace {

using redag::runtime::monotonic_now;
using redag_rclcpp::lab::ChildProcess;
using redag_rclcpp::lab::Figures;
using redag_rclcpp::lab::Operator;
using redag_rclcpp::lab::Samples;
using redag_rclcpp::lab::StackOptions;
using redag_rclcpp::lab::StackRun;

constexpr std::chrono::seconds kWarmUp(2);  // before what is measured
constexpr double kPlansPerSecond = 10;
constexpr int kJoints = 6;  // the last one is the gripper's
constexpr const char *kRobot = "--robot";
constexpr const char *kPlanner = "--planner";

constexpr const char *kDescription = "Compares executors for controller_manager's update loop.\n";

constexpr const char *kExplanation =
    R"(Contenders: stock is ros2_control_node, with the planner in a process of its
own. All others are one process with the update loop as a timer: mte and cbg
(where it was built) on executors of rclcpp, redag-none and redag-os on
ReDAGExecutor. Prefix the command with `chrt -f 10` to give all threads
of all processes a real-time priority; stock and redag-os set some of their own.

Single-threaded executors are left out. controller_manager's services wait for
the update loop, which would wait for the service.

Examples:
  ros2 run redag_rclcpp_lab bench_ros2_control --only stock,redag-os
  ros2 run redag_rclcpp_lab bench_ros2_control --rounds 5 --rate 1000 --read 0.1

The figures are medians over the runs. Exit status: 0 success; 1 a process did
not run to its end; 2 invalid options.)";

struct Loads {
  int rate = 500;
  double read = 0.2;
  double planner = 30;
};

/// The arm's joints, the gripper's joint, and the hardware behind them.
std::string robot_description(const std::string &report, const Loads &loads) {
  std::string links = "<link name=\"base\"/>";
  std::string joints;
  for (int i = 1; i <= kJoints; ++i) {
    links += fmt::format(
        "<link name=\"link{0}\"/>"
        "<joint name=\"joint{0}\" type=\"continuous\"><parent link=\"{1}\"/><child link=\"link{0}\"/></joint>",
        i, i == 1 ? "base" : fmt::format("link{}", i - 1));
    joints += fmt::format(
        "<joint name=\"joint{}\"><command_interface name=\"position\"/><state_interface name=\"position\"/></joint>",
        i);
  }
  return fmt::format(
      "<robot name=\"arm\">{}<ros2_control name=\"plant\" type=\"system\"><hardware>"
      "<plugin>redag_rclcpp_lab/Plant</plugin><param name=\"report\">{}</param><param name=\"load\">{}</param>"
      "</hardware>{}</ros2_control></robot>",
      links, report, loads.read / 1e3, joints);
}

/// Parameters of all nodes, as a file.
void write_parameters(const std::string &file, const StackRun &run, const StackOptions &options, const Loads &loads) {
  nlohmann::json nodes;
  const auto parameters = [&](const char *node) -> nlohmann::json & { return nodes[node]["ros__parameters"]; };
  const auto forward = [&](const char *controller, int first, int last) {
    nlohmann::json joints = nlohmann::json::array();
    for (int i = first; i <= last; ++i) joints.push_back(fmt::format("joint{}", i));
    parameters("controller_manager")[controller]["type"] = "redag_rclcpp_lab/Forward";
    parameters(controller)["joints"] = joints;
  };
  parameters("controller_manager")["update_rate"] = loads.rate;
  parameters("controller_manager")["joint_state_broadcaster"]["type"] = "joint_state_broadcaster/JointStateBroadcaster";
  parameters("joint_state_broadcaster") = {{"update_rate", std::min(50, loads.rate)}};
  forward("arm_controller", 1, kJoints - 1);
  forward("gripper_controller", kJoints, kJoints);
  forward("spare_controller", kJoints, kJoints);
  parameters("planner") = {{"load", loads.planner / 1e3}, {"report", run.folder + "/planner.json"}};
  if (run.contender.rfind("redag-", 0) == 0) {
    parameters("robot") = {{"preemption", run.contender.substr(6)},
                           {"config", options.config == "none" ? "" : options.config}};
  }
  std::ofstream(file) << nodes << "\n";  // YAML contains JSON
}

/// The processes of a contender: their names and command lines.
std::vector<std::pair<std::string, std::vector<std::string>>> processes(const std::string &contender,
                                                                        const std::string &parameters) {
  const std::string self = std::filesystem::read_symlink("/proc/self/exe");
  std::vector<std::pair<std::string, std::vector<std::string>>> all;
  if (contender == "stock") {
    const std::string package = "controller_manager";
    all.push_back({"ros2_control_node",
                   {ament_index_cpp::get_package_prefix(package) + "/lib/" + package + "/ros2_control_node"}});
    all.push_back({"planner", {self, kPlanner}});
  } else if (contender == "redag-os") {
    const std::string inherit = ament_index_cpp::get_package_prefix("redag_rclcpp") + "/lib/libredag_pi.so";
    all.push_back({"robot", {"/usr/bin/env", "LD_PRELOAD=" + inherit, self, kRobot, "redag"}});
  } else {
    all.push_back({"robot", {self, kRobot, contender == "redag-none" ? "redag" : contender}});
  }
  for (auto &[name, command] : all) command.insert(command.end(), {"--ros-args", "--params-file", parameters});
  return all;
}

struct Window {
  redag::Time begin;
  redag::Time end;
  [[nodiscard]] bool has(redag::Time time) const { return begin <= time && time < end; }
  [[nodiscard]] double seconds() const { return static_cast<double>(end - begin) / redag::kSecond; }
};

nlohmann::json read_report(const std::string &file) {
  std::ifstream in(file);
  if (!in) throw std::runtime_error("a process wrote no report " + file);
  return nlohmann::json::parse(in);
}

/// What the hardware saw: intervals between its reads, reads that did not come, and the age of new commands.
void report_plant(Figures &figures, const nlohmann::json &plant, const Window &window, double rate) {
  const auto period = static_cast<redag::Duration>(redag::kSecond / rate);
  Samples off;
  std::optional<redag::Time> first;
  redag::Time last = 0;
  for (const redag::Time read : plant.at("reads")) {
    if (!window.has(read)) continue;
    if (first) {
      off.add(std::abs(read - last - period));
    } else {
      first = read;
    }
    last = read;
  }
  if (off.size() == 0) throw std::runtime_error("the hardware was not read");
  const double expected = std::round(static_cast<double>(last - *first) / static_cast<double>(period));
  figures["updates missed, %"] = 100 * (expected - static_cast<double>(off.size())) / expected;
  add_samples(figures, "update interval off", off);
  Samples ages;
  for (const std::pair<redag::Time, redag::Duration> command : plant.at("commands")) {
    if (window.has(command.first)) ages.add(command.second);
  }
  add_samples(figures, "command to hardware", ages);
}

void report_planner(Figures &figures, const nlohmann::json &planner, const Window &window) {
  Samples done;
  for (const std::pair<redag::Time, redag::Time> plan : planner.at("plans")) {
    if (window.has(plan.first)) done.add(plan.second - plan.first);
  }
  figures["plans missed, %"] = 100 * (1 - static_cast<double>(done.size()) / (kPlansPerSecond * window.seconds()));
  add_samples(figures, "plan done after", done);
}

/// One run of a contender. Throws if it does not go to its end.
Figures measure(const StackRun &run, const StackOptions &options, const Loads &loads) {
  const std::string parameters = run.folder + "/parameters.yaml";
  write_parameters(parameters, run, options, loads);
  Figures figures;
  Window window{};
  const redag::Time begin = monotonic_now();
  std::vector<std::unique_ptr<ChildProcess>> children;
  for (const auto &[name, command] : processes(run.contender, parameters)) {
    children.push_back(std::make_unique<ChildProcess>(command, run.log(name)));
  }
  {
    Operator user(robot_description(run.folder + "/plant.json", loads));
    user.start();
    std::this_thread::sleep_for(kWarmUp);
    window.begin = monotonic_now();
    window.end = window.begin + std::llround(options.seconds * static_cast<double>(redag::kSecond));
    user.run(window.end);
    user.report(figures);
  }
  double used = 0;
  for (const auto &child : children) used += child->end();
  figures["processors used"] =
      used * static_cast<double>(redag::kSecond) / static_cast<double>(monotonic_now() - begin);
  report_plant(figures, read_report(run.folder + "/plant.json"), window, loads.rate);
  report_planner(figures, read_report(run.folder + "/planner.json"), window);
  return figures;
}

std::vector<std::string> contenders() {
  std::vector<std::string> all = {"stock", "mte"};
  if (redag_rclcpp::lab::check_peer("cbg")) all.emplace_back("cbg");
  all.emplace_back("redag-none");
  if (redag::runtime::probe_priority_band().top_job > 0) all.emplace_back("redag-os");
  return all;
}

}  // namespace

int main(int argc, char **argv) {
  const std::vector<std::string> arguments(argv + 1, argv + argc);
  if (!arguments.empty() && arguments[0] == kPlanner) return redag_rclcpp::lab::run_planner(argc, argv);
  if (arguments.size() >= 2 && arguments[0] == kRobot) return redag_rclcpp::lab::run_robot(arguments[1], argc, argv);
  rclcpp::init(0, nullptr);
  Loads loads;
  redag_rclcpp::lab::StackComparison comparison;
  comparison.program = "bench_ros2_control";
  comparison.description = kDescription;
  comparison.explanation = kExplanation;
  comparison.config = ament_index_cpp::get_package_share_directory("redag_rclcpp") + "/config/stacks/ros2_control.yaml";
  comparison.add_options = [&](CLI::App &app) {
    using redag_rclcpp::lab::add_number;
    add_number<int>(app, "--rate", loads.rate, 1, "Updates a second");
    add_number<double>(app, "--read", loads.read, 0, "Processor time in ms that reading the hardware\ntakes");
    add_number<double>(app, "--planner", loads.planner, 0,
                       "Processor time in ms that the planner takes, 10\ntimes a second");
  };
  comparison.contenders = contenders();
  comparison.measure = [&](const StackRun &run, const StackOptions &options) { return measure(run, options, loads); };
  const int status = run_comparison(comparison, argc, argv);
  rclcpp::shutdown();
  return status;
}
