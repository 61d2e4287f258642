// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Compares ways to run a stack of nodes. Each way is a contender, whose processes are started anew for each run. The
// contenders take turns over several rounds. Medians of what was measured are printed as a table. Programs such as
// bench_nav2 say which contenders there are and what one run does.
#pragma once

#include <CLI/CLI.hpp>
#include <functional>
#include <map>
#include <string>
#include <vector>

#include "samples.hpp"

namespace redag_rclcpp::lab {

/// Options that every comparison has.
struct StackOptions {
  int rounds = 3;
  double seconds = 10;  // measured time of a run
  std::string config;   // workload file for redag's executors; "none": they start without a file
};

/// What was measured, by name.
using Figures = std::map<std::string, double>;

/// Adds the median and the p99 in milliseconds; nothing without samples.
void add_samples(Figures &figures, const std::string &name, const Samples &samples);

/// One run, which may use `folder` for its files.
struct StackRun {
  std::string contender;
  std::string folder;  // empty at the start, for this run alone

  /// The file for what one of the run's processes prints.
  [[nodiscard]] std::string log(const std::string &process) const { return folder + "/" + process + ".log"; }
};

struct StackComparison {
  std::string program;      // its name
  std::string description;  // for --help, before the options
  std::string explanation;  // for --help, behind them
  std::string config;       // default of --config
  std::vector<std::string> contenders;
  std::function<void(CLI::App &)> add_options;  // those of this comparison alone
  /// Does one run. Throws std::exception if it does not go to its end.
  std::function<Figures(const StackRun &, const StackOptions &)> measure;
};

/// The main function of a comparison. Prints medians to stdout, and progress to stderr. Returns the exit status: 0
/// success, 1 a run failed, 2 invalid options.
int run_comparison(const StackComparison &comparison, int argc, char **argv);

}  // namespace redag_rclcpp::lab
