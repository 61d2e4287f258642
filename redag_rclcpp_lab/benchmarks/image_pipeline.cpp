// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Runs image_proc's components (github.com/ros-perception/image_pipeline) in rclcpp's component containers and in
// redag_rclcpp's. A synthetic camera feeds them, and a control loop of 500 Hz runs beside them in the same process.
// Measures how late the control loop is called, the latency from the camera to the last image, frames that are lost,
// and processor time. Containers take turns. Built if the package image_proc is present.
#include <fmt/format.h>

#include <algorithm>
#include <ament_index_cpp/get_package_prefix.hpp>
#include <ament_index_cpp/get_package_share_directory.hpp>
#include <chrono>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include "child_process.hpp"
#include "command_line.hpp"
#include "composition_interfaces/srv/load_node.hpp"
#include "contenders.hpp"
#include "rclcpp/rclcpp.hpp"
#include "rclcpp_components/component_manager.hpp"
#include "stack_comparison.hpp"

namespace {

using composition_interfaces::srv::LoadNode;
using redag_rclcpp::lab::ChildProcess;
using redag_rclcpp::lab::Figures;
using redag_rclcpp::lab::StackOptions;
using redag_rclcpp::lab::StackRun;
using Clock = std::chrono::steady_clock;
using Seconds = std::chrono::duration<double>;

constexpr double kWarmUp = 2;               // seconds at the start that the components leave out
constexpr std::chrono::seconds kLimit(30);  // of a container's answer
constexpr const char *kOwnContainer = "--container";

constexpr const char *kDescription = "Compares component containers on the components of image_proc.\n";

constexpr const char *kExplanation =
    R"(Containers: single, mt, isolated (rclcpp's component_container,
component_container_mt and component_container_isolated), events, cbg (rclcpp's
container on these executors), redag-none, redag-coop, redag-os (redag_rclcpp's
component_container). Prefix the command with `chrt -f 10` to give all threads
of all containers a real-time priority; redag-os sets those of its own.

Examples:
  ros2 run redag_rclcpp_lab bench_image_pipeline --rounds 3 --seconds 8
  ros2 run redag_rclcpp_lab bench_image_pipeline --only mt,redag-os --rate 60

The figures are medians over the runs. Exit status: 0 success; 1 a container did
not run to its end; 2 invalid options.)";

/// What the components have as options.
struct Rates {
  int width = 640;
  int height = 480;
  double images = 30;
  double control = 500;
};

/// Command lines, by the containers' names.
using Commands = std::vector<std::pair<std::string, std::vector<std::string>>>;

/// A component to load.
struct Component {
  std::string package;
  std::string plugin;
  std::vector<std::string> remappings{};
  std::vector<rclcpp::Parameter> parameters{};
};

std::string program(const std::string &package, const std::string &name) {
  return ament_index_cpp::get_package_prefix(package) + "/lib/" + package + "/" + name;
}

/// `config`: a workload file for redag's containers, or "none".
Commands containers(const std::string &config) {
  Commands all;
  all.push_back({"single", {program("rclcpp_components", "component_container")}});
  all.push_back({"mt", {program("rclcpp_components", "component_container_mt")}});
  all.push_back({"isolated", {program("rclcpp_components", "component_container_isolated")}});
  for (const std::string name : {"events", "cbg"}) {
    if (redag_rclcpp::lab::check_peer(name)) all.push_back({name, {"/proc/self/exe", kOwnContainer, name}});
  }
  std::vector<std::pair<std::string, std::string>> modes = {{"redag-none", "none"}, {"redag-coop", "cooperative"}};
  if (redag::runtime::probe_priority_band().top_job > 0) modes.emplace_back("redag-os", "os");
  for (const auto &[name, mode] : modes) {
    std::vector<std::string> command = {program("redag_rclcpp", "component_container"), "--ros-args"};
    command.insert(command.end(), {"-p", "preemption:=" + mode});
    if (config != "none") command.insert(command.end(), {"-p", "config:=" + config});
    all.push_back({name, command});
  }
  return all;
}

/// In the order in which they are loaded: image_proc's nodes take the quality of service of the publishers they find.
std::vector<Component> components(const Rates &rates, const std::string &folder) {
  const std::string own = "redag_rclcpp_lab";
  const rclcpp::Parameter frame_period("period", 1 / rates.images);
  const rclcpp::Parameter warm_up("warm_up", kWarmUp);
  const auto report = [&](const char *name) { return rclcpp::Parameter("report", folder + "/" + name); };
  return {
      {own,
       "redag_rclcpp::lab::Camera",
       {},
       {frame_period, rclcpp::Parameter("width", rates.width), rclcpp::Parameter("height", rates.height)}},
      {"image_proc", "image_proc::DebayerNode"},
      {"image_proc", "image_proc::RectifyNode", {"image:=image_color"}},
      {"image_proc",
       "image_proc::ResizeNode",
       {"image/image_raw:=image_rect", "image/camera_info:=camera_info"},
       {rclcpp::Parameter("scale_width", 0.5), rclcpp::Parameter("scale_height", 0.5)}},
      {own, "redag_rclcpp::lab::Viewer", {"image:=resize/image_raw"}, {frame_period, warm_up, report("viewer")}},
      {own,
       "redag_rclcpp::lab::Control",
       {},
       {rclcpp::Parameter("period", 1 / rates.control), warm_up, report("control")}},
  };
}

void load(rclcpp::Node::SharedPtr node, rclcpp::Client<LoadNode> &client, const Component &component) {
  auto request = std::make_shared<LoadNode::Request>();
  request->package_name = component.package;
  request->plugin_name = component.plugin;
  request->remap_rules = component.remappings;
  for (const auto &parameter : component.parameters) request->parameters.push_back(parameter.to_parameter_msg());
  auto future = client.async_send_request(request);
  if (rclcpp::spin_until_future_complete(node, future, kLimit) != rclcpp::FutureReturnCode::SUCCESS) {
    throw std::runtime_error(component.plugin + ": no answer to the request to load it");
  }
  const auto response = future.get();
  if (!response->success) throw std::runtime_error(component.plugin + ": " + response->error_message);
}

nlohmann::json read_report(const std::string &file) {
  std::ifstream in(file);
  if (!in) throw std::runtime_error("a component wrote no report");
  return nlohmann::json::parse(in);
}

Figures measure(const StackRun &run, const StackOptions &options, const Rates &rates) {
  const Commands all = containers(options.config);
  const auto container =
      std::find_if(all.begin(), all.end(), [&](const auto &candidate) { return candidate.first == run.contender; });
  const auto begin = Clock::now();
  ChildProcess process(container->second, run.log("container"));
  {
    const auto node = std::make_shared<rclcpp::Node>("bench_image_pipeline");
    const auto client = node->create_client<LoadNode>("/ComponentManager/_container/load_node");
    if (!client->wait_for_service(kLimit)) throw std::runtime_error("the container offers no service");
    for (const Component &component : components(rates, run.folder)) load(node, *client, component);
  }
  std::this_thread::sleep_for(Seconds(kWarmUp + options.seconds));
  const double used = process.end();
  const double wall = Seconds(Clock::now() - begin).count();
  const nlohmann::json control = read_report(run.folder + "/control");
  const nlohmann::json viewer = read_report(run.folder + "/viewer");
  Figures figures = {{"control missed, %",
                      100 * control.at("missed").get<double>() / std::max(1.0, control.at("points").get<double>())},
                     {"frames shown", viewer.at("frames").get<double>()},
                     {"frames lost", viewer.at("lost").get<double>()},
                     {"processors used", used / wall}};
  for (const auto &[rank, value] : control.at("lateness").items()) figures["control late, ms, " + rank] = value;
  for (const auto &[rank, value] : viewer.at("latency").items()) figures["image latency, ms, " + rank] = value;
  return figures;
}

/// rclcpp's container on another executor of the comparison.
int run_container(const std::string &executor_name) {
  rclcpp::init(0, nullptr);
  const std::shared_ptr<rclcpp::Executor> executor =
      redag_rclcpp::lab::make_peer(executor_name, std::max(2U, std::thread::hardware_concurrency()));
  const auto manager = std::make_shared<rclcpp_components::ComponentManager>(executor);
  executor->add_node(manager);
  executor->spin();
  return 0;
}

}  // namespace

int main(int argc, char **argv) {
  const std::vector<std::string> arguments(argv + 1, argv + argc);
  if (arguments.size() == 2 && arguments[0] == kOwnContainer) return run_container(arguments[1]);
  rclcpp::init(0, nullptr);
  Rates rates;
  redag_rclcpp::lab::StackComparison comparison;
  comparison.program = "bench_image_pipeline";
  comparison.description = kDescription;
  comparison.explanation = kExplanation;
  comparison.config =
      ament_index_cpp::get_package_share_directory("redag_rclcpp") + "/config/stacks/image_pipeline.yaml";
  comparison.add_options = [&](CLI::App &app) {
    using redag_rclcpp::lab::add_number;
    add_number<int>(app, "--width", rates.width, 1, "Size of the camera's images");
    add_number<int>(app, "--height", rates.height, 1, "");
    add_number<double>(app, "--rate", rates.images, 0.001, "Images a second");
    add_number<double>(app, "--control", rates.control, 0.001, "Calls of the control loop a second, of 0.3 ms each");
  };
  for (const auto &[name, command] : containers("none")) comparison.contenders.push_back(name);
  comparison.measure = [&](const StackRun &run, const StackOptions &options) { return measure(run, options, rates); };
  const int status = run_comparison(comparison, argc, argv);
  rclcpp::shutdown();
  return status;
}
