#include <fmt/format.h>

#include <memory>

#include "redag/cli/analysis_explanation.hpp"
#include "redag/cli/analysis_report.hpp"
#include "redag/cli/commands.hpp"
#include "redag/cli/options.hpp"
#include "redag/cli/run_arguments.hpp"

namespace redag::cli {
namespace {

struct Options {
  RunArguments arguments;
  std::uint32_t levels = 0;
  std::string explain;
  bool methods = false;
};

analysis::AnalysisPlatform platform_for(const Workload &workload, const Options &options) {
  analysis::AnalysisPlatform platform = analysis::platform_of(workload);
  platform.levels = options.levels;
  platform.release_overhead = options.arguments.overheads.release;
  platform.dispatch_overhead = options.arguments.overheads.dispatch;
  platform.preempt_overhead = options.arguments.overheads.preempt;
  return platform;
}

// One task or DAG in words, or all of it. False if the one is not there.
bool report(const Analysed &analysed, const Options &options, Console &console) {
  Json document;
  if (options.arguments.json) document = to_json(analysed);
  if (!options.explain.empty()) {
    const Result<Row> row = find_row(analysed, options.explain);
    if (!row) {
      console.error("--explain: " + row.error().front().message, row.error().front().hint);
      return false;
    }
    if (options.arguments.json) {
      document["explanation"] = {{"name", row->name}, {"text", explain(analysed, *row, StreamTraits{})}};
    } else {
      console.print(explain(analysed, *row, console.out_traits()));
    }
  } else if (!options.arguments.json) {
    console.print(describe(analysed, console.out_traits(), options.arguments.all_tasks));
  }
  if (options.arguments.json) {
    console.print(to_text(document));
  } else if (options.methods) {
    console.print("\n" + describe_methods());
  }
  return true;
}

int analyze_file(const Options &options, Console &console) {
  if (options.arguments.file.empty()) {
    if (options.methods && !options.arguments.json) {
      console.print(describe_methods());
      return kExitOk;
    }
    console.error("FILE is required", "only --methods does without, and not with --json");
    return kExitBad;
  }
  const std::optional<Workload> workload = load_configured(options.arguments, console);
  if (!workload) return kExitBad;
  const Result<Analysed> analysed = analyse(*workload, platform_for(*workload, options));
  if (!analysed) {
    console.note(analysed.error());
    return kExitBad;
  }
  if (!report(*analysed, options, console)) return kExitBad;
  const bool yes = analysed->report.verdict == analysis::Verdict::Schedulable;
  return options.arguments.check && !yes ? kExitNo : kExitOk;
}

}  // namespace

Action add_analyze(CLI::App &app) {
  auto options = std::make_shared<Options>();
  RunArguments &arguments = options->arguments;
  app.add_option("FILE", arguments.file, "Workload (YAML); - is standard input");
  app.add_option("--explain", options->explain, "Where the bound of one task (dag.task) or DAG comes from")
      ->type_name("TASK");
  app.add_flag("--methods", options->methods,
               "Every method's assumptions, citation and complexity; FILE may be missing");
  app.add_flag("--all-tasks", arguments.all_tasks, "A row for every task, however many");
  app.add_flag("--json", arguments.json, "Write one JSON document to standard output, and nothing else");
  app.add_flag("--check", arguments.check, "Exit with 1 if no sound method shows that every deadline is met");
  add_platform_arguments(app, arguments);
  add_count(app, "--levels", options->levels, "Priority levels; tasks that share one do not preempt; 0: one a task")
      ->group("Platform");
  add_overhead_arguments(app, arguments.overheads, "Platform");
  return [options](Console &console) { return analyze_file(*options, console); };
}

}  // namespace redag::cli
