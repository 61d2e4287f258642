// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Arguments common to the commands that analyse a workload: the workload and the platform of the analysis.
#pragma once

#include <CLI/CLI.hpp>
#include <cstdint>
#include <optional>
#include <string>

#include "redag/model/workload.hpp"
#include "redag_analysis/analyze/analyze.hpp"
#include "redag_analysis/core/task_set.hpp"
#include "redag_lab/cli/run/run_arguments.hpp"
#include "redag_lab/cli/terminal/progress.hpp"

namespace redag::cli {

struct AnalysisArguments {
  RunArguments run;
  std::uint32_t levels = 0;  // 0: one per task
  std::uint64_t effort = analysis::kUsualEffort / kEffortUnit;
  std::optional<Duration> time_limit;  // of the whole analysis

  static constexpr std::uint64_t kEffortUnit = 1'000'000;  // steps
};

/// Progress, Ctrl-C and the limits of a command that analyses. A command creates one for all its analyses. Not
/// thread-safe.
class AnalysisWatch {
 public:
  AnalysisWatch(const AnalysisArguments &arguments, Console &console) : arguments_(arguments), progress_(console) {}

  /// The options refer to this object, which must outlive them.
  [[nodiscard]] analysis::AnalyzeOptions options();
  /// Returns the reason to stop now, a clause without a final full stop; empty if there is none.
  [[nodiscard]] std::string why_stop() const;
  [[nodiscard]] Progress &progress() { return progress_; }

 private:
  const AnalysisArguments &arguments_;
  Progress progress_;
};

/// Adds --json, --all-tasks, --check (with this help), the limits and everything about the platform. The command adds
/// FILE itself.
void add_analysis_arguments(CLI::App &app, AnalysisArguments &arguments, const std::string &check_help);

/// Error: the given overheads are not those of such threads.
[[nodiscard]] Result<analysis::AnalysisPlatform> platform_for(const Workload &workload,
                                                              const AnalysisArguments &arguments,
                                                              const std::string &executor = "redag");

}  // namespace redag::cli
