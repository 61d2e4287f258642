// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Component containers as contenders of a stack comparison: rclcpp's, rclcpp's on other executors, and redag_rclcpp's
// in each preemption mode.
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "child_process.hpp"
#include "rclcpp/rclcpp.hpp"
#include "stack_comparison.hpp"

namespace redag_rclcpp::lab {

/// A component to load.
struct Component {
  std::string package;
  std::string plugin;
  std::vector<std::string> remappings{};
  std::vector<rclcpp::Parameter> parameters{};
};

/// The control loop that runs beside each stack: `rate` calls a second, each of which uses the processor for 0.3 ms. It
/// measures for `seconds` after the first `warm_up` seconds; 0: to its end.
[[nodiscard]] Component control_loop(const StackRun &run, double rate, double warm_up, double seconds = 0);

/// Adds what the run's control loop measured: how late it was called, and points of its grid that it missed. The
/// container has ended. Throws std::runtime_error.
void add_control(Figures &figures, const StackRun &run);

/// A container's process. The destructor kills it if it still runs.
class Container {
 public:
  /// Starts the run's contender. `parameters`: a parameter file for all nodes, or empty. Throws std::runtime_error.
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

/// The main function of a comparison of component containers. Adds what all of them share: the contenders, what their
/// names mean, and the folder of `config`, a file of redag_rclcpp's config/stacks. Some containers are this program,
/// started anew: then it runs to the container's end.
int run_containers(StackComparison comparison, int argc, char **argv);

}  // namespace redag_rclcpp::lab
