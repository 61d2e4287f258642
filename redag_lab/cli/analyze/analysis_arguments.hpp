// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// What the commands that analyse a workload ask for alike: the workload, and the platform on which it is looked at.
#pragma once

#include <CLI/CLI.hpp>
#include <cstdint>
#include <optional>
#include <string>

#include "redag/model/workload.hpp"
#include "redag_analysis/analyze/analyze.hpp"
#include "redag_analysis/core/system.hpp"
#include "redag_lab/cli/run/run_arguments.hpp"
#include "redag_lab/cli/terminal/progress.hpp"

namespace redag::cli {

struct AnalysisArguments {
  RunArguments run;
  std::uint32_t levels = 0;  // 0: one a task
  std::uint64_t effort = analysis::kUsualEffort / kEffortUnit;
  std::optional<Duration> time_limit;  // of the whole analysis

  static constexpr std::uint64_t kEffortUnit = 1'000'000;  // steps
};

/// Progress, Ctrl-C and the limits of a command that analyses: made once for all that it does. Not thread-safe.
class AnalysisWatch {
 public:
  AnalysisWatch(const AnalysisArguments &arguments, Console &console) : arguments_(arguments), progress_(console) {}

  /// Refer to this.
  [[nodiscard]] analysis::AnalyzeOptions options();
  /// Why no more work should be done now, a clause without a period; or empty.
  [[nodiscard]] std::string why_stop() const;
  [[nodiscard]] Progress &progress() { return progress_; }

 private:
  const AnalysisArguments &arguments_;
  Progress progress_;
  Stopwatch watch_;
};

/// --json, --all-tasks, --check (with this help), the limits and everything about the platform. FILE is the command's
/// own.
void add_analysis_arguments(CLI::App &app, AnalysisArguments &arguments, const std::string &check_help);

/// Error: the overheads that were given are not those of such threads.
[[nodiscard]] Result<analysis::AnalysisPlatform> platform_for(const Workload &workload,
                                                              const AnalysisArguments &arguments,
                                                              const std::string &executor = "redag");

}  // namespace redag::cli
