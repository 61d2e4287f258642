// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The plan of `redag experiment acceptance`: a file, options, or a file with some values replaced by options. Used on
// one thread, while the program starts and right after.
#pragma once

#include <CLI/CLI.hpp>
#include <functional>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "redag_lab/cli/terminal/console.hpp"
#include "redag_lab/experiment/acceptance_plan.hpp"

namespace redag::cli {

class PlanOptions {
 public:
  /// Declares the options. `app` and this object must outlive the parsing.
  explicit PlanOptions(CLI::App &app);

  /// Returns the plan as given. Prints mistakes by file and line, or by option.
  [[nodiscard]] std::optional<experiment::AcceptancePlan> plan(Console &console) const;

 private:
  using Edit = std::function<void(experiment::AcceptancePlan &)>;

  void add_points(CLI::App &app);
  void add_workloads(CLI::App &app);
  /// Applies `edit` if `option` was given.
  void on(CLI::Option *option, const std::string &group, Edit edit);

  std::string file_;
  experiment::AcceptancePlan given_;  // values of the options, and defaults elsewhere
  std::vector<std::pair<const CLI::Option *, Edit>> edits_;
};

}  // namespace redag::cli
