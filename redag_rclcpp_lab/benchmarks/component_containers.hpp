// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Component containers as contenders of a stack comparison: rclcpp's, rclcpp's on other executors, and redag_rclcpp's
// in each preemption mode.
#pragma once

#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "child_process.hpp"
#include "rclcpp/rclcpp.hpp"
#include "stack_comparison.hpp"

namespace redag_rclcpp::lab {

/// The containers that this build and this process can start, by their names as contenders.
[[nodiscard]] std::vector<std::string> container_names();

/// What the names mean, for --help.
inline constexpr const char *kContainersExplained =
    R"(Containers: single, mt, isolated (rclcpp's component_container,
component_container_mt and component_container_isolated), events, cbg (rclcpp's
container on these executors), redag-none, redag-coop, redag-os (redag_rclcpp's
component_container). Prefix the command with `chrt -f 10` to give all threads
of all containers a real-time priority; redag-os sets those of its own.)";

/// A component to load.
struct Component {
  std::string package;
  std::string plugin;
  std::vector<std::string> remappings{};
  std::vector<rclcpp::Parameter> parameters{};
};

/// A container's process. The destructor kills it if it still runs.
class Container {
 public:
  /// Starts the run's contender, one of container_names(). `parameters`: a parameter file for all nodes, or empty.
  /// Throws std::runtime_error.
  Container(const StackRun &run, const StackOptions &options, const std::string &parameters = "");

  /// Loads components, one by one. Throws std::runtime_error if the container refuses one or does not answer.
  void load(const std::vector<Component> &components);

  /// Ends the container, and returns the share of a processor that it used since its start. Throws
  /// std::runtime_error, as ChildProcess::end().
  [[nodiscard]] double end();

 private:
  double begin_;  // seconds on the steady clock
  ChildProcess process_;
};

/// Reads what a component wrote as it was destroyed. Throws std::runtime_error.
[[nodiscard]] nlohmann::json read_report(const std::string &file);

/// To be called first in main(). Some containers are this program, started anew: then it runs to the container's end.
/// Returns the exit status in this case.
[[nodiscard]] std::optional<int> run_own_container(int argc, char **argv);

}  // namespace redag_rclcpp::lab
