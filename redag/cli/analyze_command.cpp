#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "redag/cli/analysis_arguments.hpp"
#include "redag/cli/analysis_chains.hpp"
#include "redag/cli/analysis_explanation.hpp"
#include "redag/cli/analysis_report.hpp"
#include "redag/cli/commands.hpp"
#include "redag/cli/options.hpp"
#include "redag/cli/progress.hpp"
#include "redag/cli/signals.hpp"
#include "redag/cli/table.hpp"

namespace redag::cli {
namespace {

struct Options {
  AnalysisArguments analysis;
  std::string executor = "redag";
  std::string explain;
  std::vector<std::string> chains;
  bool methods = false;
  std::uint64_t explore = 0;  // states; 0: not asked for
};

const Choices<std::string> &executor_choices() {
  static const Choices<std::string> kAll = [] {
    Choices<std::string> all;
    for (const sched::ExecutorKind &kind : sched::executors()) all.emplace_back(kind.name, kind.name);
    return all;
  }();
  return kAll;
}

constexpr std::uint64_t kUsualStates = 1'000'000;

// Nothing if there is no such task; the console was told.
std::optional<std::vector<ChainRow>> find_chains(const Analysed &analysed, const Options &options, Console &console) {
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

// One task or DAG in words, or all of it. False if the one is not there.
bool report(const Analysed &analysed, const Options &options, Console &console) {
  const std::optional<std::vector<ChainRow>> chains = find_chains(analysed, options, console);
  if (!chains) return false;
  Json document;
  if (options.analysis.run.json) document = to_json(analysed);
  if (options.analysis.run.json && !chains->empty()) document["chains"] = to_json(analysed, *chains);
  if (!options.explain.empty()) {
    const Result<Row> row = find_row(analysed, options.explain);
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
    console.print(describe(analysed, console.out_traits(), options.analysis.run.all_tasks));
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

std::string is_positive_count(const std::string &text) {
  std::uint64_t count = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), count);
  const bool is_count = error == std::errc{} && end == text.data() + text.size() && count > 0;
  return is_count ? std::string() : "'" + text + "' is not a number of states, 1 or more";
}

// With --explore and Ctrl-C, what the other methods say remains.
Result<Analysed> analyse_configured(const Workload &workload, const Options &options, Console &console) {
  const analysis::AnalysisPlatform platform = platform_for(workload, options.analysis);
  if (options.explore == 0) return analyse(workload, platform, nullptr, options.executor);
  const InterruptGuard guard;
  Progress progress(console);
  progress.set_label("explore");
  analysis::ExplorationOptions explore;
  explore.max_states = options.explore;
  explore.proceed = [&](const analysis::ExplorationProgress &at) {
    if (progress.due()) {
      const double round = static_cast<double>(at.jobs) / static_cast<double>(at.jobs_in_a_round);
      progress.draw(std::min(1.0, round), fmt::format("{} states", format_count(at.states)));
    }
    return !InterruptGuard::interrupted();
  };
  Result<Analysed> analysed = analyse(workload, platform, &explore);
  progress.clear();
  if (InterruptGuard::interrupted()) console.warn("interrupted: the exploration is not complete");
  return analysed;
}

int analyze_file(const Options &options, Console &console) {
  if (options.analysis.run.file.empty()) {
    if (options.methods && !options.analysis.run.json) {
      console.print(describe_methods());
      return kExitOk;
    }
    console.error("FILE is required", "only --methods does without, and not with --json");
    return kExitBad;
  }
  if (options.explore > 0 && options.executor != "redag") {
    console.error("--explore follows our executor alone, not '" + options.executor + "'", "leave one of the two out");
    return kExitBad;
  }
  if (!options.chains.empty() && options.executor != "redag") {
    console.error("--chain is for our executor alone, not '" + options.executor + "'", "leave one of the two out");
    return kExitBad;
  }
  const std::optional<Workload> workload = load_configured(options.analysis.run, console);
  if (!workload) return kExitBad;
  const Result<Analysed> analysed = analyse_configured(*workload, options, console);
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
  app.add_option("FILE", options->analysis.run.file, "Workload (YAML); - is standard input");
  add_choice(app, "--executor", options->executor, executor_choices(),
             "Under our executor, or the model of another one: what is known of its order")
      ->default_str(options->executor);
  app.add_option("--explain", options->explain, "Where the bound of one task (dag.task) or DAG comes from")
      ->type_name("TASK");
  app.add_option(
         "--chain", options->chains,
         "Reaction time and data age of a cause-effect chain, also over several DAGs: dag.task,dag.task; can be "
         "given several times")
      ->type_name("TASK,TASK...")
      ->expected(1)
      ->take_all();
  app.add_flag("--methods", options->methods,
               "Every method's assumptions, citation and complexity; FILE may be missing");
  app.add_flag(
         "--explore{" + std::to_string(kUsualStates) + "}", options->explore,
         "Try all schedules of strictly periodic jobs that run to completion, in at most STATES states (default " +
             format_count(kUsualStates) + "): best and worst responses, exact on one worker")
      ->type_name("[=STATES]")
      ->check(is_positive_count);
  add_analysis_arguments(app, options->analysis, "Exit with 1 if no sound method shows that every deadline is met");
  return [options](Console &console) { return analyze_file(*options, console); };
}

}  // namespace redag::cli
