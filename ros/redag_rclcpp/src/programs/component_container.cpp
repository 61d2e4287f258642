// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// component_container is rclcpp_components' container with a ReDAGExecutor. Components need no change. The executor
// orders their callbacks, and the monitor reports on them (docs/ros2.md).
#include <fmt/format.h>
#include <pthread.h>
#include <sched.h>
#include <sys/prctl.h>

#include <algorithm>
#include <array>
#include <csignal>
#include <cstdint>
#include <cstdio>
#include <future>
#include <memory>
#include <string>
#include <vector>

#include "rclcpp/rclcpp.hpp"
#include "rclcpp_components/component_manager.hpp"
#include "redag/threads/setup.hpp"
#include "redag_rclcpp/executor.hpp"
#ifdef REDAG_INHERITS
#include "redag_rclcpp/inherit.h"
#endif
#include "redag_rclcpp/monitor.hpp"
#include "redag_rclcpp/options.hpp"

namespace {

constexpr int kExitOk = 0;
constexpr int kExitFailed = 1;    // a callback threw, or results could not be written
constexpr int kExitBadInput = 2;  // a parameter or the workload file is invalid

constexpr const char *kHelp = R"(A component container that executes callbacks by rate, across all components.

  ros2 run redag_rclcpp component_container [--ros-args -p NAME:=VALUE ...]

Arguments of rclcpp's container, for launch files that have them:
  --executor-type TYPE   single-threaded: one worker; multi-threaded and
                         events-cbg: as many as 'workers' says. The order of
                         callbacks is the same for each.
  --isolated             has no effect: components share one executor

Parameters, with their defaults:
  config ""              workload file: maps callbacks to the tasks of DAGs
  workers 0              callbacks that execute at the same time;
                         0: one per processor
  thread_num             the same under rclcpp's name
  preemption auto        auto, os, cooperative or none
  threads 0              callbacks started and unfinished at once, also in a
                         redag::Blocking; 0: with os workers + 16, else workers
  cpu_affinity []        processors of the workers; empty: all
  default_period 0.1     period in seconds of callbacks without a known one
  learn 10.0             seconds from its first message in which the rate of a
                         callback is learned, and edges
  raise_middleware true  with os: raise the middleware's threads above the
                         workers
  lock_memory false      lock memory and touch stacks, to avoid page faults
  watchdog 0.0           warn about callbacks in progress for longer than
                         these seconds; 0: no warnings
  live true              let 'redag top' show the executor (a page of memory
                         that only its owner can read)
  metrics_period 1.0     seconds between two messages on /diagnostics and
                         ~/metrics; 0: no messages
  bounds true            compare response times with their bounds
  trace ""               folder for results, written at the end
  trace_events 10000000  number of events kept for the trace
  save_path redag_workload.yaml
                         file to which ~/save writes the learned workload
  overheads ""           overheads file of 'redag doctor --measure'

Locks of the process inherit priority where real-time priorities are available.
Set REDAG_PI=0 in the environment to turn this off.

Services: ~/_container/load_node and the others of 'ros2 component';
~/metrics and ~/save (std_srvs/srv/Trigger).

The container ends on SIGINT or SIGTERM. Exit status: 0 success; 1 a callback
threw an exception or results could not be written; 2 invalid parameters.
)";

/// What a new thread takes over from the thread that starts it.
class ThreadTraits {
 public:
  /// Those of the calling thread.
  ThreadTraits() {
    pthread_getschedparam(pthread_self(), &policy_, &parameters_);
    pthread_getaffinity_np(pthread_self(), sizeof(processors_), &processors_);
    pthread_getname_np(pthread_self(), name_.data(), name_.size());
    pthread_sigmask(SIG_SETMASK, nullptr, &signals_);
    slack_ = prctl(PR_GET_TIMERSLACK);
  }

  /// Gives them to the calling thread. False: the system refused one of them.
  [[nodiscard]] bool apply() const {
    const bool is_set = pthread_setschedparam(pthread_self(), policy_, &parameters_) == 0 &&
                        pthread_setaffinity_np(pthread_self(), sizeof(processors_), &processors_) == 0;
    pthread_sigmask(SIG_SETMASK, &signals_, nullptr);
    prctl(PR_SET_TIMERSLACK, static_cast<unsigned long>(slack_), 0UL, 0UL, 0UL);
    return pthread_setname_np(pthread_self(), name_.data()) == 0 && is_set;
  }

 private:
  int policy_ = SCHED_OTHER;
  sched_param parameters_{};
  cpu_set_t processors_{};
  std::array<char, 16> name_{};
  sigset_t signals_{};  // blocked
  int slack_ = 0;       // of timers
};

/// - Loads components on a thread like main()'s. Threads that a node starts in its constructor are then as in rclcpp's
///   container. From a worker they would take its real-time priority, for instance a recorder's writer of files.
/// - Keeps an unloaded component alive until its callbacks have ended: another worker may still execute one of them.
class Manager : public rclcpp_components::ComponentManager {
 public:
  using ComponentManager::ComponentManager;

 protected:
  void on_load_node(const std::shared_ptr<rmw_request_id_t> header, const std::shared_ptr<LoadNode::Request> request,
                    std::shared_ptr<LoadNode::Response> response) override {
    std::async(std::launch::async, [&] {
      if (!of_main_.apply()) {
        RCLCPP_WARN(get_logger(), "%s is loaded with a worker's priority or processors, because Linux refused main()'s",
                    request->plugin_name.c_str());
      }
      ComponentManager::on_load_node(header, request, response);
    }).get();
  }

  void remove_node_from_executor(std::uint64_t id) override {
    const auto executor = std::dynamic_pointer_cast<redag_rclcpp::ReDAGExecutor>(executor_.lock());
    rclcpp_components::NodeInstanceWrapper &component = node_wrappers_.at(id);
    if (executor) executor->retire_node(component.get_node_base_interface(), component.get_node_instance());
  }

 private:
  const ThreadTraits of_main_;
};

/// The arguments of rclcpp's component_container.
struct Arguments {
  bool single_threaded = false;
  bool isolated = false;
  std::vector<std::string> unknown{};
  std::string error{};  // empty: none
};

constexpr std::array kExecutorTypes = {"single-threaded", "multi-threaded", "events-cbg"};

/// `arguments`: without the program's name, and without those for ROS.
Arguments parse(const std::vector<std::string> &arguments) {
  Arguments parsed;
  for (auto argument = arguments.begin(); argument != arguments.end(); ++argument) {
    if (*argument == "--isolated") {
      parsed.isolated = true;
    } else if (*argument != "--executor-type") {
      parsed.unknown.push_back(*argument);
    } else if (++argument == arguments.end()) {
      parsed.error = fmt::format("--executor-type needs a value: {}", fmt::join(kExecutorTypes, ", "));
      break;
    } else if (std::find(kExecutorTypes.begin(), kExecutorTypes.end(), *argument) == kExecutorTypes.end()) {
      parsed.error =
          fmt::format("--executor-type is '{}', but must be one of {}", *argument, fmt::join(kExecutorTypes, ", "));
    } else {
      parsed.single_threaded = *argument == "single-threaded";
    }
  }
  return parsed;
}

/// Applies the arguments to the options that the parameters state. Throws if they contradict each other.
void apply(const Arguments &arguments, Manager &manager, redag_rclcpp::ReDAGOptions &options) {
  const rclcpp::Logger logger = manager.get_logger();
  for (const std::string &argument : arguments.unknown) {
    RCLCPP_WARN(logger, "the argument '%s' is not known and ignored; --help lists arguments and parameters",
                argument.c_str());
  }
  if (arguments.isolated) {
    RCLCPP_WARN(logger, "--isolated has no effect: all components share one executor and its workers");
  }
  if (!arguments.single_threaded) return;
  const auto &given = manager.get_node_parameters_interface()->get_parameter_overrides();
  if (given.count("workers") != 0 && options.workers != 1) {
    throw rclcpp::exceptions::InvalidParameterValueException(fmt::format(
        "parameter 'workers' is {}, but --executor-type single-threaded means one worker; leave one of them "
        "out",
        options.workers));
  }
  if (given.count("thread_num") != 0 && options.workers != 1) {
    RCLCPP_WARN(logger, "'thread_num' is ignored: --executor-type single-threaded means one worker");
  }
  options.workers = 1;
}

/// Names parameters that no part of the container has, such as `-p wrkers:=2`.
void warn_of_unknown_parameters(Manager &manager) {
  for (const auto &[name, value] : manager.get_node_parameters_interface()->get_parameter_overrides()) {
    if (manager.has_parameter(name)) continue;
    RCLCPP_WARN(manager.get_logger(), "the parameter '%s' is not known and has no effect; --help lists the parameters",
                name.c_str());
  }
}

int run(const Arguments &arguments) {
  std::shared_ptr<Manager> manager;
  std::shared_ptr<redag_rclcpp::ReDAGExecutor> executor;
  std::unique_ptr<redag_rclcpp::Monitor> monitor;
  const rclcpp::Logger logger = rclcpp::get_logger("ComponentManager");
  try {
    // rclcpp's container refuses a 'thread_num' that is out of range here.
    manager = std::make_shared<Manager>(std::weak_ptr<rclcpp::Executor>(), "ComponentManager",
                                        rclcpp::NodeOptions().start_parameter_event_publisher(false));
    redag_rclcpp::ReDAGOptions options = redag_rclcpp::declare_options(*manager);
    apply(arguments, *manager, options);
    redag_rclcpp::MonitorOptions monitored = redag_rclcpp::declare_monitor_options(*manager, options);
    executor = std::make_shared<redag_rclcpp::ReDAGExecutor>(std::move(options));
    manager->set_executor(executor);
    executor->add_node(manager);
    monitor = std::make_unique<redag_rclcpp::Monitor>(manager, *executor, std::move(monitored));
    warn_of_unknown_parameters(*manager);
  } catch (const std::exception &error) {
    RCLCPP_FATAL(logger, "%s", error.what());
    return kExitBadInput;
  }

  int status = kExitOk;
  try {
    executor->spin();
  } catch (const std::exception &error) {
    RCLCPP_FATAL(logger, "a callback threw an exception: %s", error.what());
    status = kExitFailed;
  }
  if (const redag::Result<void> written = monitor->finish(); !written) {
    RCLCPP_ERROR(logger, "%s", to_string(written.error()).c_str());
    status = kExitFailed;
  }
  return status;
}

}  // namespace

int main(int argc, char **argv) {
#ifdef REDAG_INHERITS
  // Without real-time priorities there is nothing to inherit.
  if (redag::runtime::probe_priority_band().top_job == 0) redag_pi_disable();
#endif
  Arguments arguments;
  try {
    const std::vector<std::string> own = rclcpp::remove_ros_arguments(argc, argv);
    if (std::any_of(own.begin(), own.end(), [](const std::string &a) { return a == "--help" || a == "-h"; })) {
      fmt::print("{}", kHelp);
      return kExitOk;
    }
    arguments = parse({own.begin() + 1, own.end()});
    if (!arguments.error.empty()) {
      fmt::print(stderr, "component_container: {}\n", arguments.error);
      return kExitBadInput;
    }
    rclcpp::init(argc, argv);
  } catch (const std::exception &error) {
    fmt::print(stderr, "component_container: {}\n", error.what());
    return kExitBadInput;
  }
  const int status = run(arguments);
  rclcpp::shutdown();
  return status;
}
