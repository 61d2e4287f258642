// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include <fmt/format.h>

#include <algorithm>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "redag/base/text.hpp"
#include "redag/loader/cpu_list.hpp"
#include "redag_analysis/text/table.hpp"
#include "redag_lab/cli/analyze/analysis_arguments.hpp"
#include "redag_lab/cli/analyze/analysis_chains.hpp"
#include "redag_lab/cli/analyze/analysis_explanation.hpp"
#include "redag_lab/cli/analyze/analysis_margins.hpp"
#include "redag_lab/cli/analyze/analysis_report.hpp"
#include "redag_lab/cli/terminal/commands.hpp"
#include "redag_lab/cli/terminal/options.hpp"
#include "redag_lab/cli/terminal/progress.hpp"
#include "redag_lab/cli/terminal/signals.hpp"

namespace redag::cli {
namespace {

struct AnalyzeOptions {
  AnalysisArguments analysis;
  std::string executor = "redag";
  std::string explain;
  std::vector<std::string> chains;
  std::vector<std::string> only;  // names of methods
  bool methods = false;
  bool all = false;
  bool sensitivity = false;
};

const Choices<std::string> &executor_choices() {
  static const Choices<std::string> kAll = [] {
    Choices<std::string> all;
    for (const executors::ExecutorKind &kind : executors::all()) all.emplace_back(kind.name, kind.name);
    return all;
  }();
  return kAll;
}

constexpr std::uint64_t kMostEffort = 1'000'000'000;

using Parts = std::vector<lab::AnalysedPart>;

// What the command line asks of one part.
struct Asked {
  std::vector<ChainRow> chains;
  std::vector<lab::Margin> margins;  // of --sensitivity
  bool all_margins = true;           // false: stopped before the last one
  std::optional<lab::Row> row;       // of --explain
  SourceText source;                 // likewise
};

// Returns where a task or DAG of this name is, or the error of the part with the nearest name.
Result<std::size_t> part_with(const Parts &parts, const std::string &name) {
  std::optional<Diagnostics> nearest;
  for (std::size_t p = 0; p < parts.size(); ++p) {
    const Result<lab::Row> found = find_row(parts[p].analysed, name);
    if (found) return p;
    if (!nearest || found.error().front().hint.rfind("did you mean", 0) == 0) nearest = found.error();
  }
  return tl::unexpected<Diagnostics>(*std::move(nearest));
}

// Returns the part that has all tasks of a chain.
Result<std::size_t> part_with_chain(const Parts &parts, const std::string &chain) {
  std::optional<std::size_t> part;
  std::string first;
  for (const std::string &name : names_in(chain)) {
    const Result<std::size_t> at = part_with(parts, name);
    if (!at) return at;
    if (!part) {
      part = *at;
      first = name;
    }
    if (*part == *at) continue;
    return make_error(fmt::format("{} is in cluster {}, and {} in cluster {}", in_quotes(first),
                                  in_quotes(parts[*part].part.name), in_quotes(name), in_quotes(parts[*at].part.name)),
                      "a chain is bounded within one cluster: ask for its pieces one by one");
  }
  return *part;
}

// Finds what is asked of each part. Returns nothing, with an error on the console, if a task is unknown.
std::optional<std::vector<Asked>> find_asked(const Parts &parts, const AnalyzeOptions &options,
                                             const std::string &source, Console &console) {
  std::vector<Asked> asked(parts.size());
  const auto refuse = [&console](const char *option, const Diagnostics &why) {
    console.error(fmt::format("{}: {}", option, why.front().message), why.front().hint);
    return std::nullopt;
  };
  for (const std::string &chain : options.chains) {
    const Result<std::size_t> part = part_with_chain(parts, chain);
    if (!part) return refuse("--chain", part.error());
    Result<ChainRow> row = find_chain(parts[*part].analysed, chain);
    if (!row) return refuse("--chain", row.error());
    asked[*part].chains.push_back(*std::move(row));
  }
  if (!options.explain.empty()) {
    const Result<std::size_t> part = part_with(parts, options.explain);
    if (!part) return refuse("--explain", part.error());
    asked[*part].row = find_row(parts[*part].analysed, options.explain).value();
    asked[*part].source = {options.analysis.run.file, source, parts[*part].part.dags};
  }
  return asked;
}

// A line for each cluster before what is said of it; empty for a workload without clusters.
std::string heading(const ClusterPart &part, const StreamTraits &terminal) {
  if (!part.is_cluster()) return {};
  const std::uint32_t last = part.first_worker + part.workload.platform.workers - 1;
  const std::string workers = last == part.first_worker ? fmt::format("worker {}", last)
                                                        : fmt::format("workers {}-{}", part.first_worker, last);
  return tinted(fmt::format("cluster {}", part.name), Tint::Strong, terminal.colour) + ": " + workers +
         (part.cpus.empty() ? "" : ", processors " + format_cpu_list(part.cpus)) + "\n";
}

std::string text_of(const lab::AnalysedPart &part, const Asked &asked, const AnalyzeOptions &options,
                    const StreamTraits &terminal) {
  const bool every_task = options.analysis.run.all_tasks;
  std::string text;
  if (asked.row) {
    text = explain(part.analysed, *asked.row, terminal, asked.source);
  } else if (options.explain.empty()) {
    text = heading(part.part, terminal);
    text +=
        options.all || every_task ? describe(part.analysed, terminal, every_task) : summarise(part.analysed, terminal);
  }
  if (!asked.chains.empty()) text += "\n" + describe(part.analysed, asked.chains, terminal);
  if (!asked.margins.empty()) text += "\n" + describe(part.analysed, asked.margins, terminal, every_task);
  return text;
}

Json json_of(const lab::AnalysedPart &part, const Asked &asked, const AnalyzeOptions &options) {
  Json document = to_json(part.analysed, options.methods);
  if (!asked.chains.empty()) document["chains"] = to_json(part.analysed, asked.chains);
  if (options.sensitivity) {
    document["sensitivity"] = {{"complete", asked.all_margins}, {"limits", to_json(part.analysed, asked.margins)}};
  }
  if (asked.row) {
    document["explanation"] = {{"name", asked.row->name},
                               {"text", explain(part.analysed, *asked.row, StreamTraits{}, asked.source)}};
  }
  return document;
}

Json json_of(const Parts &parts, const std::vector<Asked> &asked, const AnalyzeOptions &options) {
  if (!parts.front().part.is_cluster()) return json_of(parts.front(), asked.front(), options);
  Json document = {{"format", "redag.cluster_analysis/1"},
                   {"workload", parts.front().analysed.workload.name},
                   {"schedulable", lab::is_schedulable(parts)},
                   {"clusters", Json::array()}};
  for (std::size_t p = 0; p < parts.size(); ++p) {
    document["clusters"].push_back(Json{{"name", parts[p].part.name},
                                        {"first_worker", parts[p].part.first_worker},
                                        {"cpus", parts[p].part.cpus},
                                        {"analysis", json_of(parts[p], asked[p], options)}});
  }
  return document;
}

// Finds the margin of every execution time of a part. Those found before an early end remain.
void find_margins(const lab::Analysed &analysed, AnalysisWatch &watch, Asked &asked, Console &console) {
  std::vector<lab::Margin> &margins = asked.margins;
  const std::vector<lab::Knob> knobs = lab::knobs_of(analysed.workload);
  Progress &progress = watch.progress();
  lab::SensitivityOptions searching;
  searching.stop = [&] {
    if (progress.due()) {
      const double share = static_cast<double>(margins.size()) / static_cast<double>(knobs.size());
      progress.draw(share, knob_name(analysed, knobs[margins.size()]) + progress.left(share));
    }
    return !watch.why_stop().empty();
  };
  for (const lab::Knob &knob : knobs) {
    auto margin =
        lab::margin_of(analysed.workload, analysed.task_set.platform, knob, lab::accepted_by_analysis, searching);
    if (!margin) break;
    margins.push_back(*std::move(margin));
  }
  progress.clear();
  asked.all_margins = margins.size() == knobs.size();
  if (asked.all_margins) return;
  console.warn(fmt::format("{}: these are {} of {} limits", watch.why_stop(), format_count(margins.size()),
                           format_count(knobs.size())),
               "raise --time-limit, or analyse a smaller workload");
}

// Reports one task or DAG in words, or the whole analysis. Returns false if that task or DAG is unknown.
bool report(const Parts &parts, const AnalyzeOptions &options, const std::string &source, AnalysisWatch &watch,
            Console &console) {
  std::optional<std::vector<Asked>> asked = find_asked(parts, options, source, console);
  if (!asked) return false;
  for (std::size_t p = 0; options.sensitivity && p < parts.size(); ++p) {
    find_margins(parts[p].analysed, watch, (*asked)[p], console);
  }
  if (options.analysis.run.json) {
    console.print(to_text(json_of(parts, *asked, options)));
    return true;
  }
  bool has_text = false;
  for (std::size_t p = 0; p < parts.size(); ++p) {
    const std::string text = text_of(parts[p], (*asked)[p], options, console.out_traits());
    if (has_text && !text.empty()) console.print("\n");
    has_text = has_text || !text.empty();
    console.say(text);
  }
  if (options.methods) console.say("\n" + describe_methods());
  return true;
}

// Analyses the workload. After Ctrl-C, the answers of the other methods remain.
Result<Parts> analyse_configured(const Workload &workload, const AnalyzeOptions &options, AnalysisWatch &watch) {
  return platform_for(workload, options.analysis, options.executor)
      .and_then([&](const analysis::AnalysisPlatform &platform) {
        return lab::analyse_parts(workload, platform, options.executor, watch.options(), options.only);
      });
}

int analyze_file(const AnalyzeOptions &options, Console &console) {
  if (options.analysis.run.file.empty()) {  // with --methods
    if (options.analysis.run.json) {
      console.print(to_text(methods_json()));
    } else {
      console.say(describe_methods());
    }
    return kExitOk;
  }
  const char *ours = !options.chains.empty() ? "--chain" : options.sensitivity ? "--sensitivity" : nullptr;
  if (ours != nullptr && options.executor != "redag") {
    console.error(fmt::format("{} is available for ReDAG-RT only, not for executor '{}'", ours, options.executor),
                  fmt::format("leave out {} or --executor", ours));
    return kExitBad;
  }
  std::string source;
  const std::optional<Workload> workload = load_configured(options.analysis.run, console, {.waits = true}, &source);
  if (!workload || !takes_arguments({*lab::parse_variant(options.executor)}, options.analysis.run, console))
    return kExitBad;
  const InterruptGuard guard;
  AnalysisWatch watch(options.analysis, console);
  const Result<Parts> analysed = analyse_configured(*workload, options, watch);
  if (!ok(analysed, console)) return kExitBad;
  if (!report(*analysed, options, source, watch, console)) return kExitBad;
  return options.analysis.run.check && !lab::is_schedulable(*analysed) ? kExitNo : kExitOk;
}

}  // namespace

Action add_analyze(CLI::App &app) {
  auto options = std::make_shared<AnalyzeOptions>();
  app.add_option("FILE", options->analysis.run.file, "Workload file (YAML); - reads standard input")
      ->type_name("WORKLOAD");
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
  app.add_flag("--sensitivity", options->sensitivity,
               "Show how far each execution time can grow, or must shrink, to have every deadline shown");
  app.add_flag("--all", options->all,
               "Show all tasks and DAGs, the result of each method, and the methods that do not apply");
  add_count(app, "--effort", options->analysis.effort, {0, kMostEffort},
            "Steps after which one method gives up, in millions; 0: no limit. The result is the same on every machine")
      ->group("Limits");
  add_analysis_arguments(app, options->analysis,
                         "Exit with status 1 unless a sound method shows that every deadline is met");
  app.callback([options] {
    const bool wants_file = !options->explain.empty() || !options->chains.empty() || options->sensitivity;
    if (options->analysis.run.file.empty() && (!options->methods || wants_file)) throw CLI::RequiredError("FILE");
  });
  return [options](Console &console) { return analyze_file(*options, console); };
}

}  // namespace redag::cli
