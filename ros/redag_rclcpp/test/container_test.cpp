// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Runs the component container as a program of its own: loading, execution, metrics, a clean end with results, and bad
// parameters.
#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <pthread.h>
#include <sched.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <optional>
#include <sstream>
#include <thread>

#include "composition_interfaces/srv/load_node.hpp"
#include "composition_interfaces/srv/unload_node.hpp"
#include "rclcpp/rclcpp.hpp"
#include "redag/base/time.hpp"
#include "redag/trace/events_file.hpp"
#include "redag_analysis/metrics/check/trace_checker.hpp"
#include "spinning.hpp"
#include "std_msgs/msg/float64.hpp"
#include "std_srvs/srv/trigger.hpp"

namespace redag_rclcpp {
namespace {

using namespace std::chrono_literals;
using composition_interfaces::srv::LoadNode;
using composition_interfaces::srv::UnloadNode;
using std::chrono::steady_clock;
using std_msgs::msg::Float64;
using std_srvs::srv::Trigger;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;
using Json = nlohmann::json;

constexpr const char *kWorkload = R"(name: test
platform: {workers: 2, preemption: cooperative}
dags:
  - name: fast
    tasks:
      - {name: sensor, period: 10ms, wcet: 5ms, callback: {node: /fast/sensor, timer: any}}
      - {name: filter, wcet: 5ms, activation: data, after: sensor, callback: {node: /fast/filter, subscription: /fast/samples}}
)";

/// A child process. The destructor kills it if it still runs.
class Process {
 public:
  Process(const std::vector<std::string> &arguments, const std::string &output) {
    std::vector<char *> argv;
    for (const std::string &argument : arguments) argv.push_back(const_cast<char *>(argument.c_str()));
    argv.push_back(nullptr);
    posix_spawn_file_actions_t actions;
    posix_spawn_file_actions_init(&actions);
    posix_spawn_file_actions_addopen(&actions, 1, output.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0600);
    posix_spawn_file_actions_adddup2(&actions, 1, 2);
    EXPECT_EQ(posix_spawn(&id_, argv[0], &actions, nullptr, argv.data(), environ), 0);
    posix_spawn_file_actions_destroy(&actions);
  }
  ~Process() {
    if (id_ <= 0) return;
    kill(id_, SIGKILL);
    waitpid(id_, nullptr, 0);
  }
  Process(const Process &) = delete;
  Process &operator=(const Process &) = delete;

  void interrupt() const { kill(id_, SIGINT); }

  /// Returns the exit code; -1 if a signal ended the process, -2 if it does not end.
  int wait() {
    int status = 0;
    const auto end = steady_clock::now() + kLimit;
    while (waitpid(id_, &status, WNOHANG) == 0) {
      if (steady_clock::now() > end) return -2;
      std::this_thread::sleep_for(10ms);
    }
    id_ = -1;
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  }

 private:
  pid_t id_ = -1;
};

class ContainerTest : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_ = std::filesystem::temp_directory_path() / ("redag_container_test_" + std::to_string(getpid()));
    output_ = folder_ / "output";
    // An install prefix that contains only the components.
    const std::filesystem::path index = folder_ / "share/ament_index/resource_index";
    std::filesystem::create_directories(index / "rclcpp_components");
    std::ofstream components(index / "rclcpp_components" / "examples");
    for (const char *name : {"Sensor", "Filter", "Control", "Map", "Planner"}) {
      components << "redag_rclcpp::examples::" << name << ";" << COMPONENTS << "\n";
    }
    components << "redag_rclcpp::Threaded;" << THREADED << "\n";
    const char *prefixes = std::getenv("AMENT_PREFIX_PATH");
    setenv("AMENT_PREFIX_PATH", (folder_.string() + ":" + (prefixes ? prefixes : "")).c_str(), 1);
    rclcpp::init(0, nullptr);
    spinning_.emplace();
    node_ = std::make_shared<rclcpp::Node>("tester");
    spinning_->add_node(node_);
  }
  void TearDown() override {
    spinning_.reset();
    node_.reset();
    rclcpp::shutdown();
    if (HasFailure()) std::cerr << text();
    std::filesystem::remove_all(folder_);
  }

  Process start(std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), CONTAINER);
    return Process(arguments, output_);
  }
  int run(const std::vector<std::string> &arguments) { return start(arguments).wait(); }
  [[nodiscard]] std::string text() const {
    std::ostringstream text;
    text << std::ifstream(output_).rdbuf();
    return text.str();
  }

  template <class Service>
  typename Service::Response::SharedPtr call(const std::string &name, const typename Service::Request &request) {
    const auto client = node_->create_client<Service>(name);
    if (!client->wait_for_service(kLimit)) return nullptr;
    // The request is repeated, because Fast DDS can lose the response to a client that the service has discovered in
    // part (github.com/ros2/rmw_fastrtps/issues/842).
    constexpr auto kPatience = 10s;
    for (const auto end = steady_clock::now() + kLimit; steady_clock::now() < end;) {
      auto future = client->async_send_request(std::make_shared<typename Service::Request>(request));
      if (spinning_->spin_until_future_complete(future, kPatience) == rclcpp::FutureReturnCode::SUCCESS) {
        return future.get();
      }
    }
    return nullptr;
  }

  LoadNode::Response::SharedPtr load(const std::string &plugin, const std::vector<rclcpp::Parameter> &parameters,
                                     const std::string &space = "redag_rclcpp::examples::") {
    LoadNode::Request request;
    request.package_name = "examples";
    request.plugin_name = space + plugin;
    request.node_namespace = "/fast";
    for (const auto &parameter : parameters) request.parameters.push_back(parameter.to_parameter_msg());
    return call<LoadNode>("/ComponentManager/_container/load_node", request);
  }

  template <class Condition>
  bool eventually(Condition condition) {
    return redag_rclcpp::eventually(condition, [&] { spinning_->spin_once(10ms); });
  }

  std::filesystem::path folder_;
  std::filesystem::path output_;
  rclcpp::Node::SharedPtr node_;
  std::optional<rclcpp::executors::SingleThreadedExecutor> spinning_;
};

TEST_F(ContainerTest, HelpIsPrinted) {
  EXPECT_EQ(run({"--help"}), 0);
  EXPECT_THAT(text(), AllOf(HasSubstr("component_container"), HasSubstr("preemption"), HasSubstr("save_path")));
}

TEST_F(ContainerTest, BadParametersEndItWithTwo) {
  EXPECT_EQ(run({"--ros-args", "-p", "preemption:=full"}), 2);
  EXPECT_THAT(text(), AllOf(HasSubstr("'preemption' is full"), HasSubstr("cooperative, os")));

  const std::string file = folder_ / "robot.yaml";
  std::ofstream(file) << "name: robot\ndags:\n  - name: control\n    tsks: []\n";
  EXPECT_EQ(run({"--ros-args", "-p", "config:=" + file}), 2);
  EXPECT_THAT(text(), HasSubstr(file + ":4:"));

  EXPECT_EQ(run({"--ros-args", "-p", "trace:=/proc/nowhere"}), 2);
  EXPECT_THAT(text(), HasSubstr("/proc/nowhere"));

  EXPECT_EQ(run({"--ros-args", "-p", "workers"}), 2);
}

TEST_F(ContainerTest, ArgumentsOfRclcppsContainerAreChecked) {
  EXPECT_EQ(run({"--executor-type", "fastest"}), 2);
  EXPECT_THAT(text(), AllOf(HasSubstr("'fastest'"), HasSubstr("single-threaded, multi-threaded, events-cbg")));
  EXPECT_EQ(run({"--executor-type"}), 2);
  EXPECT_THAT(text(), HasSubstr("needs a value"));
  EXPECT_EQ(run({"--executor-type", "single-threaded", "--ros-args", "-p", "workers:=2"}), 2);
  EXPECT_THAT(text(), AllOf(HasSubstr("'workers' is 2"), HasSubstr("one worker")));
  EXPECT_EQ(run({"--ros-args", "-p", "thread_num:=1", "-p", "workers:=2"}), 2);
  EXPECT_THAT(text(), AllOf(HasSubstr("'thread_num' is 1"), HasSubstr("'workers' (2)")));
  EXPECT_EQ(run({"--ros-args", "-p", "thread_num:=0"}), 2);
  EXPECT_THAT(text(), HasSubstr("thread_num"));
}

TEST_F(ContainerTest, ArgumentsOfRclcppsContainerAreAccepted) {
  const auto workers_with = [&](const std::vector<std::string> &arguments) {
    Process container = start(arguments);
    const auto metrics = call<Trigger>("/ComponentManager/metrics", Trigger::Request());
    container.interrupt();
    EXPECT_EQ(container.wait(), 0);
    return metrics ? Json::parse(metrics->message)["workers"].get<int>() : -1;
  };
  EXPECT_EQ(workers_with({"--executor-type", "single-threaded", "--isolated", "--nonsense"}), 1);
  EXPECT_THAT(text(), AllOf(HasSubstr("--isolated has no effect"), HasSubstr("'--nonsense' is not known")));
  EXPECT_EQ(workers_with({"--executor-type", "multi-threaded", "--ros-args", "-p", "thread_num:=1", "-p", "wrkers:=2"}),
            1);
  EXPECT_THAT(text(), HasSubstr("'wrkers' is not known"));
  EXPECT_EQ(workers_with({"--executor-type", "events-cbg", "--ros-args", "-p", "workers:=3"}), 3);
  EXPECT_THAT(text(), Not(HasSubstr("not known")));
}

TEST_F(ContainerTest, ACallbackWaitsForItsOwnGroupsClientsWithOneWorker) {
  Process container = start({"--ros-args", "-p", "workers:=1"});
  for (const char *plugin : {"Map", "Planner"}) {
    const auto loaded = load(plugin, {});
    ASSERT_NE(loaded, nullptr);
    ASSERT_TRUE(loaded->success) << loaded->error_message;
  }
  EXPECT_TRUE(eventually([&] { return text().find("plans with the map") != std::string::npos; }));
  container.interrupt();
  EXPECT_EQ(container.wait(), 0);
}

// In mode `os` the worker that loads a component is a real-time thread.
TEST_F(ContainerTest, ThreadsOfANodesConstructorAreLikeThoseOfMain) {
  Process container = start({"--ros-args", "-p", "workers:=2", "-p", "preemption:=auto"});
  const std::string report = (folder_ / "thread").string();
  const auto loaded = load("Threaded", {rclcpp::Parameter("report", report)}, "redag_rclcpp::");
  ASSERT_NE(loaded, nullptr);
  ASSERT_TRUE(loaded->success) << loaded->error_message;
  std::ifstream in(report);
  int policy = -1;
  int priority = -1;
  std::string name;
  in >> policy >> priority >> name;
  sched_param own{};
  int own_policy = -1;
  pthread_getschedparam(pthread_self(), &own_policy, &own);  // what the container has inherited
  EXPECT_EQ(policy, own_policy);
  EXPECT_EQ(priority, own.sched_priority);
  EXPECT_EQ(name, "component_conta");
  container.interrupt();
  EXPECT_EQ(container.wait(), 0);
}

TEST_F(ContainerTest, ComponentsRunAndResultsAreWrittenAtTheEnd) {
  const std::string config = folder_ / "robot.yaml";
  std::ofstream(config) << kWorkload;
  const std::filesystem::path results = folder_ / "results";
  Process container =
      start({"--ros-args", "-p", "config:=" + config, "-p", "trace:=" + results.string(), "-p", "metrics_period:=0.1"});
  for (const char *plugin : {"Sensor", "Filter"}) {
    const auto loaded = load(plugin, {{"load", 0.001}});
    ASSERT_NE(loaded, nullptr);
    ASSERT_TRUE(loaded->success) << loaded->error_message;
  }
  int estimates = 0;
  const auto subscription =
      node_->create_subscription<Float64>("/fast/estimate", 1, [&](const Float64 &) { ++estimates; });
  EXPECT_TRUE(eventually([&] { return estimates >= 10; }));

  const auto metrics = call<Trigger>("/ComponentManager/metrics", Trigger::Request());
  ASSERT_NE(metrics, nullptr);
  const Json json = Json::parse(metrics->message);
  EXPECT_EQ(json["workers"], 2);
  EXPECT_EQ(json["preemption"], "cooperative");
  std::map<std::string, Json> tasks;
  for (const Json &task : json["tasks"]) tasks[task["task"]] = task;
  ASSERT_EQ(tasks.count("fast.filter"), 1U) << json.dump(1);
  EXPECT_GE(tasks["fast.filter"]["finished"], 9) << "the tenth estimate may be of a callback that goes on";
  EXPECT_GE(tasks["fast.filter"]["execution"]["max_ns"], redag::kMillisecond);
  EXPECT_EQ(tasks["fast.sensor"]["period_ns"], 10 * redag::kMillisecond);

  // Unloads a component while its callback is in progress; the container must survive.
  bool is_controlled = false;
  const auto commands =
      node_->create_subscription<Float64>("/fast/command", 1, [&](const Float64 &) { is_controlled = true; });
  const auto another = load("Control", {{"load", 0.05}});
  ASSERT_TRUE(another && another->success);
  ASSERT_TRUE(eventually([&] { return is_controlled; }));
  UnloadNode::Request unload;
  unload.unique_id = another->unique_id;
  const auto unloaded = call<UnloadNode>("/ComponentManager/_container/unload_node", unload);
  ASSERT_TRUE(unloaded && unloaded->success);
  estimates = 0;
  EXPECT_TRUE(eventually([&] { return estimates >= 3; }));

  container.interrupt();
  EXPECT_EQ(container.wait(), 0);
  EXPECT_THAT(text(), HasSubstr("wrote " + results.string()));
  for (const char *name : {"summary.json", "jobs.csv", "trace.pftrace", "metrics.json"}) {
    EXPECT_TRUE(std::filesystem::exists(results / name)) << name;
  }
  const auto trace = redag::trace::read_trace(results / "events.redag");
  ASSERT_TRUE(trace) << to_string(trace.error());
  const auto check = redag::metrics::check_trace(*trace, redag::metrics::rules_for(trace->info));
  EXPECT_TRUE(check.ok()) << check.to_string();
  const Json summary = Json::parse(std::ifstream(results / "summary.json"));
  EXPECT_EQ(summary["run"]["preemption"], "cooperative");
  EXPECT_GT(summary["total"]["finished"], 20);
}

}  // namespace
}  // namespace redag_rclcpp
