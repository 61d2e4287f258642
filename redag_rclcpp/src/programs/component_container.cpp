// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// component_container is rclcpp_components' container with a ReDAGExecutor. Components need no change. The executor
// orders their callbacks, and the monitor reports on them (docs/ros2.md).
#include <fmt/format.h>

#include <cstdint>
#include <cstdio>
#include <cstring>
#include <memory>

#include "rclcpp/rclcpp.hpp"
#include "rclcpp_components/component_manager.hpp"
#include "redag/runtime/setup.hpp"
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

Parameters, with their defaults:
  config ""              workload file: maps callbacks to the tasks of DAGs
  workers 0              callbacks that execute at the same time;
                         0: one per processor
  preemption auto        auto, os, cooperative or none
  policy rate_monotonic  rate_monotonic, deadline_monotonic, fixed, edf, fifo
                         or chain_aware
  ties share             order of equal priorities: share (earlier release
                         first) or fixed
  threads 0              with os: callbacks started and unfinished at once;
                         0: workers + 16
  cpu_affinity []        processors of the workers; empty: all
  default_period 0.1     period in seconds of callbacks without a known one
  learn 10.0             seconds in which rates and edges are learned
  raise_middleware true  with os: raise the middleware's threads above the
                         workers
  lock_memory false      lock memory and touch stacks, to avoid page faults
  spin 0.0               seconds for which an idle worker looks for work;
                         not with os
  watchdog 0.0           warn about callbacks in progress for longer than
                         these seconds; 0: no warnings
  live true              let 'redag top' show the executor (a page of memory
                         that only its owner can read)
  metrics_period 1.0     seconds between two messages on /diagnostics and
                         ~/metrics; 0: no messages
  bounds true            compare response times with their bounds
  trace ""               folder for results, written at the end
  trace_events 10000000  number of events kept for the trace
  metrics_file ""        file for the last metrics, written at the end
  save_path redag_workload.yaml
                         file to which ~/save writes the learned workload
  overheads ""           file of overheads from 'redag calibrate'

Locks of the process inherit priority where real-time priorities are available.
Set REDAG_PI=0 in the environment to turn this off.

Services: ~/_container/load_node and the others of 'ros2 component';
~/metrics and ~/save (std_srvs/srv/Trigger).

The container ends on SIGINT or SIGTERM. Exit status: 0 success; 1 a callback
threw an exception or results could not be written; 2 invalid parameters.
)";

/// Keeps an unloaded component alive until its callbacks have ended: another worker may still execute one of them.
class Manager : public rclcpp_components::ComponentManager {
 public:
  using ComponentManager::ComponentManager;

 protected:
  void remove_node_from_executor(std::uint64_t id) override {
    const auto executor = std::dynamic_pointer_cast<redag_rclcpp::ReDAGExecutor>(executor_.lock());
    rclcpp_components::NodeInstanceWrapper &component = node_wrappers_.at(id);
    if (executor) executor->retire_node(component.get_node_base_interface(), component.get_node_instance());
  }
};

int run() {
  const auto manager = std::make_shared<Manager>(std::weak_ptr<rclcpp::Executor>(), "ComponentManager",
                                                 rclcpp::NodeOptions().start_parameter_event_publisher(false));
  const rclcpp::Logger logger = manager->get_logger();
  std::shared_ptr<redag_rclcpp::ReDAGExecutor> executor;
  std::unique_ptr<redag_rclcpp::Monitor> monitor;
  try {
    redag_rclcpp::ReDAGOptions options = redag_rclcpp::declare_options(*manager);
    redag_rclcpp::MonitorOptions monitored = redag_rclcpp::declare_monitor_options(*manager, options);
    executor = std::make_shared<redag_rclcpp::ReDAGExecutor>(std::move(options));
    manager->set_executor(executor);
    executor->add_node(manager);
    monitor = std::make_unique<redag_rclcpp::Monitor>(manager, *executor, std::move(monitored));
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
  for (int i = 1; i < argc && std::strcmp(argv[i], "--ros-args") != 0; ++i) {
    if (std::strcmp(argv[i], "--help") == 0 || std::strcmp(argv[i], "-h") == 0) {
      fmt::print("{}", kHelp);
      return kExitOk;
    }
  }
#ifdef REDAG_INHERITS
  // Without real-time priorities there is nothing to inherit.
  if (redag::runtime::probe_priority_band().top_job == 0) redag_pi_disable();
#endif
  try {
    rclcpp::init(argc, argv);
  } catch (const std::exception &error) {
    fmt::print(stderr, "component_container: {}\n", error.what());
    return kExitBadInput;
  }
  const int status = run();
  rclcpp::shutdown();
  return status;
}
