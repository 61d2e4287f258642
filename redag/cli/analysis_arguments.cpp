#include "redag/cli/analysis_arguments.hpp"

#include "redag/cli/options.hpp"

namespace redag::cli {

void add_analysis_arguments(CLI::App &app, AnalysisArguments &arguments, const std::string &check_help) {
  RunArguments &run = arguments.run;
  app.add_flag("--all-tasks", run.all_tasks, "A row for every task, however many");
  app.add_flag("--json", run.json, "Write one JSON document to standard output, and nothing else");
  app.add_flag("--check", run.check, check_help);
  add_platform_arguments(app, run);
  add_count(app, "--levels", arguments.levels, "Priority levels; tasks that share one do not preempt; 0: one a task")
      ->group("Platform");
  add_overhead_arguments(app, run.overheads, "Platform");
}

analysis::AnalysisPlatform platform_for(const Workload &workload, const AnalysisArguments &arguments) {
  analysis::AnalysisPlatform platform = analysis::platform_of(workload);
  platform.levels = arguments.levels;
  platform.release_overhead = arguments.run.overheads.release;
  platform.dispatch_overhead = arguments.run.overheads.dispatch;
  platform.preempt_overhead = arguments.run.overheads.preempt;
  return platform;
}

}  // namespace redag::cli
