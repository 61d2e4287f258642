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

  config            workload file: which callback is which task of which DAG      ""
  workers           callbacks at the same time; 0: one a processor                0
  preemption        auto, os, cooperative, none                                   auto
  policy            rate_monotonic, deadline_monotonic, fixed, edf, fifo, chain_aware
                                                                                  rate_monotonic
  ties              of equal priorities: share (the earlier release first), fixed share
  threads           os: callbacks started and unfinished at once; 0: workers + 16 0
  cpu_affinity      processors of the workers                                     []
  default_period    seconds, where nobody says                                    0.1
  learn             seconds in which rates and edges are learned                  10.0
  raise_middleware  os: the middleware's threads above the workers                true
  lock_memory       lock the memory, touch the stacks: no page faults there       false
  spin              seconds that an idle worker looks for work; not with os       0.0
  watchdog          seconds; callbacks in progress for longer are named; 0: none  0.0
  live              let redag top see it (a page of memory that only its owner   true
                    can read)
  metrics_period    seconds between /diagnostics and ~/metrics; 0: none           1.0
  bounds            compare response times with their bounds                      true
  trace             folder for results, written at the end                        ""
  trace_events      events kept for it                                            10000000
  metrics_file      file for the last metrics, written at the end                 ""
  save_path         where ~/save writes what was learned                          redag_workload.yaml

The locks of the process inherit priority where real-time priorities are to be had; REDAG_PI=0 in the environment
turns that off.

Services: ~/_container/load_node and its kin (ros2 component ...), ~/metrics and ~/save (std_srvs/srv/Trigger).
Ends with SIGINT or SIGTERM: 0; 1 if a callback threw or results could not be written; 2 for bad parameters.
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
    RCLCPP_FATAL(logger, "a callback threw: %s", error.what());
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
