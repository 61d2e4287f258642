// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "component_containers.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <ament_index_cpp/get_package_prefix.hpp>
#include <ament_index_cpp/get_package_share_directory.hpp>
#include <chrono>
#include <fstream>
#include <memory>
#include <stdexcept>
#include <thread>
#include <utility>

#include "composition_interfaces/srv/load_node.hpp"
#include "contenders.hpp"
#include "rclcpp_components/component_manager.hpp"

namespace redag_rclcpp::lab {

namespace {

using composition_interfaces::srv::LoadNode;

constexpr std::chrono::seconds kLimit(30);  // of a container's answer
constexpr const char *kOwnContainer = "--container";
constexpr const char *kControlReport = "control";  // in the folder of a run

constexpr const char *kExplanation =
    R"(Containers: single, mt, isolated (rclcpp's component_container,
component_container_mt and component_container_isolated), events, cbg (rclcpp's
container on these executors), redag-none, redag-coop, redag-os (redag_rclcpp's
component_container). Prefix the command with `chrt -f 10` to give all threads
of all containers a real-time priority; redag-os sets those of its own.)";

double now_in_seconds() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

std::string program(const std::string &package, const std::string &name) {
  return ament_index_cpp::get_package_prefix(package) + "/lib/" + package + "/" + name;
}

/// Command lines, by the containers' names. `config`: a workload file for redag's containers, or "none".
std::vector<std::pair<std::string, std::vector<std::string>>> commands(const std::string &config) {
  std::vector<std::pair<std::string, std::vector<std::string>>> all;
  all.push_back({"single", {program("rclcpp_components", "component_container"), "--ros-args"}});
  all.push_back({"mt", {program("rclcpp_components", "component_container_mt"), "--ros-args"}});
  all.push_back({"isolated", {program("rclcpp_components", "component_container_isolated"), "--ros-args"}});
  for (const std::string name : {"events", "cbg"}) {
    if (check_peer(name)) all.push_back({name, {"/proc/self/exe", kOwnContainer, name, "--ros-args"}});
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

std::vector<std::string> command_of(const std::string &name, const std::string &config, const std::string &parameters) {
  for (auto &[candidate, command] : commands(config)) {
    if (candidate != name) continue;
    std::vector<std::string> all = command;
    if (!parameters.empty()) all.insert(all.end(), {"--params-file", parameters});
    return all;
  }
  throw std::runtime_error("there is no container '" + name + "'");
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

/// rclcpp's container on another executor of the comparison.
int run_container(const std::string &executor_name, int argc, char **argv) {
  rclcpp::init(argc, argv);
  const std::shared_ptr<rclcpp::Executor> executor =
      make_peer(executor_name, std::max(2U, std::thread::hardware_concurrency()));
  const auto manager = std::make_shared<rclcpp_components::ComponentManager>(executor);
  executor->add_node(manager);
  executor->spin();
  return 0;
}

}  // namespace

Component control_loop(const StackRun &run, double rate, double warm_up, double seconds) {
  return {"redag_rclcpp_lab",
          "redag_rclcpp::lab::Control",
          {},
          {rclcpp::Parameter("period", 1 / rate), rclcpp::Parameter("warm_up", warm_up),
           rclcpp::Parameter("seconds", seconds), rclcpp::Parameter("report", run.folder + "/" + kControlReport)}};
}

void add_control(Figures &figures, const StackRun &run) {
  const nlohmann::json control = read_report(run.folder + "/" + kControlReport);
  figures["control missed, %"] =
      100 * control.at("missed").get<double>() / std::max(1.0, control.at("points").get<double>());
  for (const auto &[rank, value] : control.at("lateness").items()) figures["control late, ms, " + rank] = value;
}

Container::Container(const StackRun &run, const StackOptions &options, const std::string &parameters)
    : begin_(now_in_seconds()), process_(command_of(run.contender, options.config, parameters), run.log("container")) {}

void Container::load(const std::vector<Component> &components) {
  const auto node = std::make_shared<rclcpp::Node>("component_loader");
  const auto client = node->create_client<LoadNode>("/ComponentManager/_container/load_node");
  if (!client->wait_for_service(kLimit)) throw std::runtime_error("the container offers no service");
  for (const Component &component : components) lab::load(node, *client, component);
}

double Container::end() {
  const double used = process_.end();
  return used / (now_in_seconds() - begin_);
}

nlohmann::json read_report(const std::string &file) {
  std::ifstream in(file);
  if (!in) throw std::runtime_error("a component wrote no report " + file);
  return nlohmann::json::parse(in);
}

int run_containers(StackComparison comparison, int argc, char **argv) {
  if (argc >= 3 && std::string(argv[1]) == kOwnContainer) return run_container(argv[2], argc, argv);
  rclcpp::init(0, nullptr);
  comparison.explanation = fmt::format("{}\n\n{}", kExplanation, comparison.explanation);
  comparison.config =
      ament_index_cpp::get_package_share_directory("redag_rclcpp") + "/config/stacks/" + comparison.config;
  for (const auto &[name, command] : commands("none")) comparison.contenders.push_back(name);
  const int status = run_comparison(comparison, argc, argv);
  rclcpp::shutdown();
  return status;
}

}  // namespace redag_rclcpp::lab
