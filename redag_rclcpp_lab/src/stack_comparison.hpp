// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Compares ways to run a stack of nodes. Each way is a contender, whose processes are started anew for each run. The
// contenders take turns over several rounds. Medians of what was measured are printed as a table. Programs such as
// bench_image_pipeline say which contenders there are and what one run does.
#pragma once

#include <functional>
#include <map>
#include <string>
#include <vector>

namespace redag_rclcpp::lab {

/// Options that every comparison has.
struct StackOptions {
  int rounds = 3;       // --rounds
  double seconds = 10;  // --seconds, of a run
  std::string only;     // --only: names of contenders, separated by commas; "": all
  std::string config;   // --config: workload file for redag's executors; "none": they start without a file
  std::string logs;     // --logs: folder for what the processes print; "": it is kept only if a run fails
};

/// An option of one comparison, whose value is a number above 0.
struct NumberOption {
  std::string name;  // "--rate"
  double *value;
  bool whole = false;  // a whole number of at most 1,000,000
};

/// What was measured, by name.
using Figures = std::map<std::string, double>;

/// One run, which may use `folder` for its files.
struct StackRun {
  std::string contender;
  std::string folder;  // empty at the start, for this run alone

  /// The file for what one of the run's processes prints.
  [[nodiscard]] std::string log(const std::string &process) const { return folder + "/" + process + ".log"; }
};

struct StackComparison {
  std::string program;  // its name, for messages
  std::string help;     // printed for --help
  std::string config;   // default of --config
  std::vector<NumberOption> numbers{};
  std::vector<std::string> contenders;
  /// Does one run. Throws std::exception if it does not go to its end.
  std::function<Figures(const StackRun &, const StackOptions &)> measure;
};

/// The main function of a comparison. `arguments`: without the program's name. Prints medians to stdout, and progress
/// to stderr. Returns the exit status: 0 success, 1 a run failed, 2 invalid options.
int run_comparison(const StackComparison &comparison, const std::vector<std::string> &arguments);

}  // namespace redag_rclcpp::lab
