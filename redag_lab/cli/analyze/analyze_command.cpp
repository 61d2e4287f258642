// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "redag/base/text.hpp"
#include "redag_analysis/text/table.hpp"
#include "redag_lab/cli/analyze/analysis_arguments.hpp"
#include "redag_lab/cli/analyze/analysis_chains.hpp"
#include "redag_lab/cli/analyze/analysis_explanation.hpp"
#include "redag_lab/cli/analyze/analysis_report.hpp"
#include "redag_lab/cli/terminal/commands.hpp"
#include "redag_lab/cli/terminal/options.hpp"
#include "redag_lab/cli/terminal/progress.hpp"
#include "redag_lab/cli/terminal/signals.hpp"

namespace redag::cli {
namespace {

struct Options {
  AnalysisArguments analysis;
  std::string executor = "redag";
  std::string explain;
  std::vector<std::string> chains;
  std::vector<std::string> only;  // names of methods
  bool methods = false;
  bool all = false;
  std::uint64_t explore = 0;  // states; 0: not requested
};

const Choices<std::string> &executor_choices() {
  static const Choices<std::string> kAll = [] {
    Choices<std::string> all;
    for (const executors::ExecutorKind &kind : executors::all()) all.emplace_back(kind.name, kind.name);
    return all;
  }();
  return kAll;
}

constexpr std::uint64_t kUsualStates = 1'000'000;
constexpr std::uint64_t kMostEffort = 1'000'000'000;

// Finds the requested chains. Returns nothing, with an error on the console, if a task is unknown.
std::optional<std::vector<ChainRow>> find_chains(const lab::Analysed &analysed, const Options &options,
                                                 Console &console) {
  std::vector<ChainRow> rows;
  for (const std::string &chain : options.chains) {
    Result<ChainRow> row = find_chain(analysed, chain);
    if (!row) {
      console.error("--chain: " + row.error().front().message, row.error().front().hint);
      return std::nullopt;
    }
    rows.push_back(*std::move(row));
  }
  return rows;
}

// Reports one task or DAG in words, or the whole analysis. Returns false if that task or DAG is unknown.
bool report(const lab::Analysed &analysed, const Options &options, Console &console) {
  const std::optional<std::vector<ChainRow>> chains = find_chains(analysed, options, console);
  if (!chains) return false;
  Json document;
  if (options.analysis.run.json) document = to_json(analysed, options.methods);
  if (options.analysis.run.json && !chains->empty()) document["chains"] = to_json(analysed, *chains);
  if (!options.explain.empty()) {
    const Result<lab::Row> row = find_row(analysed, options.explain);
    if (!row) {
      console.error("--explain: " + row.error().front().message, row.error().front().hint);
      return false;
    }
    if (options.analysis.run.json) {
      document["explanation"] = {{"name", row->name}, {"text", explain(analysed, *row, StreamTraits{})}};
    } else {
      console.print(explain(analysed, *row, console.out_traits()));
    }
  } else if (!options.analysis.run.json) {
    const bool every_task = options.analysis.run.all_tasks;
    console.print(options.all || every_task ? describe(analysed, console.out_traits(), every_task)
                                            : summarise(analysed, console.out_traits()));
  }
  if (!options.analysis.run.json && !chains->empty()) {
    console.print("\n" + describe(analysed, *chains, console.out_traits()));
  }
  if (options.analysis.run.json) {
    console.print(to_text(document));
  } else if (options.methods) {
    console.print("\n" + describe_methods());
  }
  return true;
}

constexpr std::uint64_t kMostStates = 1'000'000'000;

std::string is_states(const std::string &text) {
  std::uint64_t count = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), count);
  const bool is_count = error == std::errc{} && end == text.data() + text.size() && count > 0 && count <= kMostStates;
  return is_count ? std::string()
                  : fmt::format("{} is not a number of states from 1 to {}", in_quotes(text), kMostStates);
}

// Analyses the workload. After Ctrl-C, the answers of the other methods remain.
Result<lab::Analysed> analyse_configured(const Workload &workload, const Options &options, Console &console) {
  const Result<analysis::AnalysisPlatform> configured = platform_for(workload, options.analysis, options.executor);
  if (!configured) return tl::unexpected(configured.error());
  const analysis::AnalysisPlatform &platform = *configured;
  const InterruptGuard guard;
  AnalysisWatch watch(options.analysis, console);
  if (options.explore == 0) {
    return lab::analyse(workload, platform, nullptr, options.executor, watch.options(), options.only);
  }
  Progress &progress = watch.progress();
  progress.set_label("explore");
  analysis::ExplorationOptions explore;
  explore.max_states = options.explore;
  explore.proceed = [&](const analysis::ExplorationProgress &at) {
    if (progress.due()) {
      const double round = static_cast<double>(at.jobs) / static_cast<double>(at.jobs_in_a_round);
      progress.draw(std::min(1.0, round), fmt::format("{} states", format_count(at.states)));
    }
    return watch.why_stop().empty();
  };
  Result<lab::Analysed> analysed =
      lab::analyse(workload, platform, &explore, options.executor, watch.options(), options.only);
  progress.clear();
  if (InterruptGuard::interrupted()) console.warn("interrupted: the exploration is incomplete");
  return analysed;
}

int analyze_file(const Options &options, Console &console) {
  if (options.analysis.run.file.empty()) {
    const bool wants_file =
        options.analysis.run.json || !options.explain.empty() || !options.chains.empty() || options.explore > 0;
    if (options.methods && !wants_file) {
      console.print(describe_methods());
      return kExitOk;
    }
    console.error("FILE is required", "only --methods works without it");
    return kExitBad;
  }
  if (options.explore > 0 && options.executor != "redag") {
    console.error("--explore is available for ReDAG-RT only, not for executor '" + options.executor + "'",
                  "leave out --explore or --executor");
    return kExitBad;
  }
  if (!options.chains.empty() && options.executor != "redag") {
    console.error("--chain is available for ReDAG-RT only, not for executor '" + options.executor + "'",
                  "leave out --chain or --executor");
    return kExitBad;
  }
  const std::optional<Workload> workload = load_configured(options.analysis.run, console);
  if (!workload || !takes_arguments({*lab::parse_variant(options.executor)}, options.analysis.run, console))
    return kExitBad;
  const Result<lab::Analysed> analysed = analyse_configured(*workload, options, console);
  if (!analysed) {
    console.note(analysed.error());
    return kExitBad;
  }
  if (!report(*analysed, options, console)) return kExitBad;
  const bool yes = analysed->report.verdict == analysis::Verdict::Schedulable;
  return options.analysis.run.check && !yes ? kExitNo : kExitOk;
}

}  // namespace

Action add_analyze(CLI::App &app) {
  auto options = std::make_shared<Options>();
  app.add_option("FILE", options->analysis.run.file, "Workload file (YAML); - reads standard input");
  add_choice(app, "--executor", options->executor, executor_choices(),
             "Executor to analyse: ReDAG-RT, or a model of one of rclcpp's executors")
      ->default_str(options->executor);
  app.add_option("--explain", options->explain, "Explain the bound of one task (dag.task) or DAG")->type_name("TASK");
  app.add_option(
         "--chain", options->chains,
         "Reaction time and data age of a cause-effect chain, which may span several DAGs; can be given several times")
      ->type_name("TASK,TASK...")
      ->expected(1)
      ->take_all()
      ->allow_extra_args(false);
  app.add_flag("--methods", options->methods,
               "Describe every method: its assumptions, citation and complexity. FILE is optional; with --json, every "
               "method's bound of every task is included");
  app.add_option("--method", options->only, "Use only this method; can be given several times")
      ->type_name("NAME")
      ->expected(1)
      ->take_all()
      ->allow_extra_args(false);
  app.add_flag("--all", options->all,
               "Show all tasks and DAGs, the result of each method, and the methods that do not apply");
  app.add_flag(
         "--explore{" + std::to_string(kUsualStates) + "}", options->explore,
         "Explore all schedules of strictly periodic jobs that run to completion, in at most STATES states (default " +
             format_count(kUsualStates) + "); gives best and worst responses, exact on one worker")
      ->type_name("[=STATES]")
      ->disable_flag_override(false)
      ->check(is_states);
  add_count(app, "--effort", options->analysis.effort, {0, kMostEffort},
            "Steps after which one method gives up, in millions; 0: no limit. The result is the same on every machine")
      ->group("Limits");
  add_analysis_arguments(app, options->analysis,
                         "Exit with status 1 unless a sound method shows that every deadline is met");
  return [options](Console &console) { return analyze_file(*options, console); };
}

}  // namespace redag::cli
