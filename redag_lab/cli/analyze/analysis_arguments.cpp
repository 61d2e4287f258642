// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/cli/analyze/analysis_arguments.hpp"

#include <fmt/format.h>

#include "redag_lab/cli/terminal/options.hpp"
#include "redag_lab/cli/terminal/signals.hpp"

namespace redag::cli {
namespace {

constexpr std::uint32_t kMaxLevels = 1'000'000;  // larger than the number of tasks in practice

}  // namespace

void add_analysis_arguments(CLI::App &app, AnalysisArguments &arguments, const std::string &check_help) {
  RunArguments &run = arguments.run;
  app.add_flag("--all-tasks", run.all_tasks, "Show every task, however many there are");
  app.add_flag("--json", run.json, "Write one JSON document, and nothing else, to standard output");
  app.add_flag("--check", run.check, check_help);
  add_duration(app, "--time-limit", arguments.time_limit, "Begin no further work after this time (default: no limit)")
      ->group("Limits");
  add_platform_arguments(app, run);
  add_count(app, "--levels", arguments.levels, {0, kMaxLevels},
            "Number of priority levels; tasks of one level do not preempt each other; 0: one level for each priority")
      ->group("Platform");
  add_overhead_arguments(app, run, "Platform");
}

analysis::AnalyzeOptions AnalysisWatch::options() {
  analysis::AnalyzeOptions options;
  options.effort = arguments_.effort * AnalysisArguments::kEffortUnit;
  options.stop = [this](const analysis::AnalysisProgress &at) {
    if (progress_.due()) {
      const double done = (static_cast<double>(at.index) + at.at.done) / static_cast<double>(at.count);
      const auto effort = static_cast<double>(arguments_.effort * AnalysisArguments::kEffortUnit);
      const std::string limit =
          effort > 0 ? fmt::format(", {:.0f} % of its effort", 100 * static_cast<double>(at.at.steps) / effort) : "";
      progress_.draw(done, fmt::format("{}{}{}", at.method.name, limit, progress_.left(done)));
    }
    return why_stop();
  };
  return options;
}

std::string AnalysisWatch::why_stop() const {
  if (InterruptGuard::interrupted()) return "interrupted";
  if (arguments_.time_limit && progress_.elapsed() > *arguments_.time_limit) {
    return fmt::format("the time limit of {} has passed", humanize_duration(*arguments_.time_limit));
  }
  return {};
}

Result<analysis::AnalysisPlatform> platform_for(const Workload &workload, const AnalysisArguments &arguments,
                                                const std::string &executor) {
  analysis::AnalysisPlatform platform = analysis::platform_of(workload);
  platform.levels = arguments.levels;
  platform.release_overhead = arguments.run.overheads.release;
  platform.dispatch_overhead = arguments.run.overheads.dispatch;
  platform.preempt_overhead = arguments.run.overheads.preempt;
  if (!arguments.run.calibration) return platform;
  const bool realtime = executor == "redag" && is_realtime(workload.platform.preemption);
  return arguments.run.calibration->of(realtime).map(
      [&](const Overheads &machine) { return analysis::charge(platform, machine); });
}

}  // namespace redag::cli
