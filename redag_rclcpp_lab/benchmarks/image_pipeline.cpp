// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Runs image_proc's components (github.com/ros-perception/image_pipeline) in rclcpp's component containers and in
// redag_rclcpp's. A synthetic camera feeds them, and a control loop of 500 Hz runs beside them in the same process.
// Measures how late the control loop is called, the latency from the camera to the last image, frames that are lost,
// and processor time. Containers take turns. Built if the package image_proc is present.
#include <fcntl.h>
#include <fmt/format.h>
#include <signal.h>
#include <spawn.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <ament_index_cpp/get_package_prefix.hpp>
#include <ament_index_cpp/get_package_share_directory.hpp>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>
#include <sstream>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include "composition_interfaces/srv/load_node.hpp"
#include "contenders.hpp"
#include "rclcpp/rclcpp.hpp"
#include "rclcpp_components/component_manager.hpp"

namespace {

using composition_interfaces::srv::LoadNode;
using redag_rclcpp::lab::median;
using Clock = std::chrono::steady_clock;
using Seconds = std::chrono::duration<double>;

constexpr double kWarmUp = 2;               // seconds at the start that the components leave out
constexpr std::chrono::seconds kLimit(30);  // of a container's answer, and of its end
constexpr const char *kOwnContainer = "--container";

constexpr const char *kHelp = R"(Compares component containers on the components of image_proc.

  ros2 run redag_rclcpp_lab bench_image_pipeline [OPTION VALUE ...]

  --rounds 3       runs of each container; the containers take turns
  --seconds 10     measured time of a run
  --only NAMES     some of the containers, as in: mt,redag-os
  --width 640      size of the camera's images
  --height 480
  --rate 30        images a second
  --control 500    calls of the control loop a second, of 0.3 ms each
  --config FILE    workload file of redag's containers; the default is
                   config/stacks/image_pipeline.yaml of redag_rclcpp. 'none':
                   they start without a file
  --logs FOLDER    keeps what the containers print

Containers: single, mt, isolated (rclcpp's component_container,
component_container_mt and component_container_isolated), events, cbg (rclcpp's
container on these executors), redag-none, redag-coop, redag-os (redag_rclcpp's
component_container). Prefix the command with `chrt -f 10` to give all threads
of all containers a real-time priority; redag-os sets those of its own.

The figures are medians over the runs. Exit status: 0 success; 1 a container did
not run to its end; 2 invalid options.
)";

struct Options {
  int rounds = 3;
  double seconds = 10;
  std::string only;
  int width = 640;
  int height = 480;
  double rate = 30;
  double control = 500;
  std::string config;
  std::string logs;
};

/// A component container of the comparison: its command line.
struct Container {
  std::string name;
  std::vector<std::string> command;
};

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

std::vector<Container> containers(const Options &options) {
  std::vector<Container> all;
  all.push_back({"single", {program("rclcpp_components", "component_container")}});
  all.push_back({"mt", {program("rclcpp_components", "component_container_mt")}});
  all.push_back({"isolated", {program("rclcpp_components", "component_container_isolated")}});
  for (const std::string name : {"events", "cbg"}) {
    if (redag_rclcpp::lab::check_peer(name)) all.push_back({name, {"/proc/self/exe", kOwnContainer, name}});
  }
  std::vector<std::pair<std::string, std::string>> modes = {{"redag-none", "none"}, {"redag-coop", "cooperative"}};
  if (redag::runtime::probe_priority_band().top_job > 0) modes.emplace_back("redag-os", "os");
  for (const auto &[name, mode] : modes) {
    Container container{name, {program("redag_rclcpp", "component_container"), "--ros-args"}};
    container.command.insert(container.command.end(), {"-p", "preemption:=" + mode});
    if (options.config != "none")
      container.command.insert(container.command.end(), {"-p", "config:=" + options.config});
    all.push_back(container);
  }
  return all;
}

/// In the order in which they are loaded: image_proc's nodes take the quality of service of the publishers they find.
std::vector<Component> components(const Options &options, const std::string &folder) {
  const std::string own = "redag_rclcpp_lab";
  const rclcpp::Parameter frame_period("period", 1 / options.rate);
  const rclcpp::Parameter warm_up("warm_up", kWarmUp);
  const auto report = [&](const char *name) { return rclcpp::Parameter("report", folder + "/" + name); };
  return {
      {own,
       "redag_rclcpp::lab::Camera",
       {},
       {frame_period, rclcpp::Parameter("width", options.width), rclcpp::Parameter("height", options.height)}},
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
       {rclcpp::Parameter("period", 1 / options.control), warm_up, report("control")}},
  };
}

/// A child process. The destructor kills it if it still runs.
class Process {
 public:
  /// `output`: a file that gets what the process prints.
  Process(const std::vector<std::string> &command, const std::string &output) {
    std::vector<char *> arguments;
    for (const std::string &argument : command) arguments.push_back(const_cast<char *>(argument.c_str()));
    arguments.push_back(nullptr);
    posix_spawn_file_actions_t actions;
    posix_spawn_file_actions_init(&actions);
    posix_spawn_file_actions_addopen(&actions, STDOUT_FILENO, output.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0644);
    posix_spawn_file_actions_adddup2(&actions, STDOUT_FILENO, STDERR_FILENO);
    const int error = posix_spawn(&id_, arguments[0], &actions, nullptr, arguments.data(), environ);
    posix_spawn_file_actions_destroy(&actions);
    if (error != 0) throw std::runtime_error(fmt::format("cannot start {}: {}", command[0], std::strerror(error)));
  }
  ~Process() {
    if (id_ <= 0) return;
    kill(id_, SIGKILL);
    waitpid(id_, nullptr, 0);
  }
  Process(const Process &) = delete;
  Process &operator=(const Process &) = delete;

  /// Ends the process by SIGINT, and returns the processor time in seconds that it used. Throws if it ends otherwise.
  double end() {
    kill(id_, SIGINT);
    int status = 0;
    rusage usage{};
    for (const auto begin = Clock::now(); wait4(id_, &status, WNOHANG, &usage) == 0;) {
      if (Clock::now() - begin > kLimit) throw std::runtime_error("the container does not end");
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
    }
    id_ = -1;
    if (!WIFEXITED(status) || WEXITSTATUS(status) != 0) throw std::runtime_error("the container failed");
    const auto in_seconds = [](const timeval &t) {
      return static_cast<double>(t.tv_sec) + 1e-6 * static_cast<double>(t.tv_usec);
    };
    return in_seconds(usage.ru_utime) + in_seconds(usage.ru_stime);
  }

 private:
  pid_t id_ = -1;
};

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

using Figures = std::map<std::string, double>;

/// One run of a container. Throws if it does not go to its end.
Figures measure(const Container &container, const Options &options, const std::string &folder, const std::string &log) {
  for (const char *report : {"/control", "/viewer"}) std::filesystem::remove(folder + report);  // of the last run
  const auto begin = Clock::now();
  Process process(container.command, log);
  {
    const auto node = std::make_shared<rclcpp::Node>("bench_image_pipeline");
    const auto client = node->create_client<LoadNode>("/ComponentManager/_container/load_node");
    if (!client->wait_for_service(kLimit)) throw std::runtime_error("the container offers no service");
    for (const Component &component : components(options, folder)) load(node, *client, component);
  }
  std::this_thread::sleep_for(Seconds(kWarmUp + options.seconds));
  const double used = process.end();
  const double wall = Seconds(Clock::now() - begin).count();
  const nlohmann::json control = read_report(folder + "/control");
  const nlohmann::json viewer = read_report(folder + "/viewer");
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

/// Throws std::invalid_argument for an unknown option or a bad value.
Options parse(const std::vector<std::string> &arguments) {
  Options options;
  const auto number = [](const std::string &option, const std::string &text) {
    std::size_t read = 0;
    double value = 0;
    try {
      value = std::stod(text, &read);
    } catch (const std::exception &) {
      read = 0;
    }
    if (read != text.size() || text.empty() || !(value > 0)) {
      throw std::invalid_argument(fmt::format("{} is '{}', but must be a number above 0", option, text));
    }
    return value;
  };
  const auto whole = [&](const std::string &option, const std::string &text) {
    const double value = number(option, text);
    if (value != std::floor(value) || value > 1e6) {
      throw std::invalid_argument(
          fmt::format("{} is '{}', but must be a whole number of at most 1000000", option, text));
    }
    return static_cast<int>(value);
  };
  for (std::size_t i = 0; i < arguments.size(); i += 2) {
    const std::string &option = arguments[i];
    if (i + 1 == arguments.size()) throw std::invalid_argument(option + " needs a value, or is no option (see --help)");
    const std::string &value = arguments[i + 1];
    if (option == "--rounds") {
      options.rounds = whole(option, value);
    } else if (option == "--seconds") {
      options.seconds = number(option, value);
    } else if (option == "--only") {
      options.only = value;
    } else if (option == "--width") {
      options.width = whole(option, value);
    } else if (option == "--height") {
      options.height = whole(option, value);
    } else if (option == "--rate") {
      options.rate = number(option, value);
    } else if (option == "--control") {
      options.control = number(option, value);
    } else if (option == "--config") {
      options.config = value;
    } else if (option == "--logs") {
      options.logs = value;
    } else {
      throw std::invalid_argument(option + " is no option (see --help)");
    }
  }
  if (options.config.empty()) {
    options.config =
        ament_index_cpp::get_package_share_directory("redag_rclcpp") + "/config/stacks/image_pipeline.yaml";
  }
  if (options.config != "none" && !std::filesystem::is_regular_file(options.config)) {
    throw std::invalid_argument(fmt::format("--config: there is no file '{}'", options.config));
  }
  return options;
}

/// The containers that --only names. Throws std::invalid_argument for an unknown one.
std::vector<Container> selected(const Options &options) {
  const std::vector<Container> all = containers(options);
  if (options.only.empty()) return all;
  std::vector<Container> some;
  std::istringstream names(options.only);
  for (std::string name; std::getline(names, name, ',');) {
    const auto found = std::find_if(all.begin(), all.end(), [&](const Container &c) { return c.name == name; });
    if (found == all.end()) throw std::invalid_argument(fmt::format("--only: no container is called '{}'", name));
    some.push_back(*found);
  }
  return some;
}

int compare(const Options &options, const std::vector<Container> &compared) {
  std::string folder = (std::filesystem::temp_directory_path() / "bench_image_pipeline.XXXXXX").string();
  if (mkdtemp(folder.data()) == nullptr) throw std::runtime_error("cannot make a folder such as " + folder);
  const std::string logs = options.logs.empty() ? folder : options.logs;
  std::filesystem::create_directories(logs);
  std::map<std::string, std::map<std::string, std::vector<double>>> results;  // by figure, then by container
  for (int round = 1; round <= options.rounds; ++round) {
    for (const Container &container : compared) {
      const std::string log = fmt::format("{}/{}.{}.log", logs, container.name, round);
      try {
        const Figures figures = measure(container, options, folder, log);
        fmt::print(stderr, "round {} of {}: {}:", round, options.rounds, container.name);
        for (const auto &[figure, value] : figures) {
          results[figure][container.name].push_back(value);
          fmt::print(stderr, " {} {:.2f};", figure, value);
        }
        fmt::print(stderr, "\n");
      } catch (const std::exception &error) {
        fmt::print(stderr, "bench_image_pipeline: {}: {}; what it printed is in {}\n", container.name, error.what(),
                   log);
        return 1;
      }
    }
  }
  std::filesystem::remove_all(folder);
  fmt::print("{:24}", "medians");
  for (const Container &container : compared) fmt::print("{:>12}", container.name);
  for (auto &[figure, by_name] : results) {
    fmt::print("\n{:24}", figure);
    for (const Container &container : compared) fmt::print("{:>12.3f}", median(by_name[container.name]));
  }
  fmt::print("\n");
  return 0;
}

}  // namespace

int main(int argc, char **argv) {
  const std::vector<std::string> arguments(argv + 1, argv + argc);
  if (std::count(arguments.begin(), arguments.end(), "--help") != 0) {
    fmt::print("{}", kHelp);
    return 0;
  }
  if (arguments.size() == 2 && arguments[0] == kOwnContainer) return run_container(arguments[1]);
  Options options;
  std::vector<Container> compared;
  try {
    options = parse(arguments);
    compared = selected(options);
  } catch (const std::exception &error) {
    fmt::print(stderr, "bench_image_pipeline: {}\n", error.what());
    return 2;
  }
  rclcpp::init(0, nullptr);
  int status = 1;
  try {
    status = compare(options, compared);
  } catch (const std::exception &error) {
    fmt::print(stderr, "bench_image_pipeline: {}\n", error.what());
  }
  rclcpp::shutdown();
  return status;
}
