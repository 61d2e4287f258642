// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include <fmt/format.h>

#include <algorithm>
#include <memory>

#include "redag/base/text.hpp"
#include "redag_analysis/text/table.hpp"
#include "redag_lab/cli/analyze/analysis_arguments.hpp"
#include "redag_lab/cli/analyze/analysis_explanation.hpp"
#include "redag_lab/cli/analyze/sensitivity_report.hpp"
#include "redag_lab/cli/terminal/commands.hpp"
#include "redag_lab/cli/terminal/options.hpp"
#include "redag_lab/cli/terminal/progress.hpp"
#include "redag_lab/cli/terminal/signals.hpp"
#include "redag_lab/run/simulated_verdict.hpp"

namespace redag::cli {
namespace {

constexpr std::uint32_t kMostProbes = 100'000;
constexpr Duration kPeriods = 20;  // length of a simulation, in longest periods

struct SensitivityOptions {
  AnalysisArguments analysis;
  std::string task;
  std::uint32_t probes = lab::SensitivityOptions{}.probes;
  bool simulate = false;
};

// Returns the knobs of the named task or DAG only. Returns nothing, with an error, if there is no such task or DAG.
std::optional<std::vector<lab::Knob>> chosen_knobs(const lab::Analysed &analysed, const std::string &name,
                                                   Console &console) {
  std::vector<lab::Knob> knobs = lab::knobs_of(analysed.workload, analysed.task_set);
  if (name.empty()) return knobs;
  const Result<lab::Row> row = find_row(analysed, name);
  if (!row) {
    console.error("--task: " + row.error().front().message, row.error().front().hint);
    return std::nullopt;
  }
  // The rate of a task that is released with its whole DAG is the DAG's rate, and counts as the task's.
  std::vector<std::uint32_t> wanted;
  std::vector<std::uint32_t> released;
  for (std::uint32_t t = 0; t < analysed.task_set.tasks.size(); ++t) {
    const analysis::CompiledTask &task = analysed.task_set.tasks[t];
    if (task_name(analysed, TaskId(t)) == row->name) released = analysed.task_set.units[task.unit].tasks;
    if (task_name(analysed, TaskId(t)) == row->name || analysed.task_set.dags[task.dag.value].name == row->name) {
      wanted.push_back(t);
    }
  }
  const auto is_within = [](const std::vector<std::uint32_t> &part, const std::vector<std::uint32_t> &whole) {
    return std::all_of(part.begin(), part.end(),
                       [&](std::uint32_t t) { return std::find(whole.begin(), whole.end(), t) != whole.end(); });
  };
  const auto is_other = [&](const lab::Knob &knob) {
    if (knob.kind == lab::Knob::Kind::AllWcets) return true;
    if (knob.kind == lab::Knob::Kind::Wcet) return !is_within(knob.tasks, wanted);
    return !is_within(knob.tasks, wanted) && !is_within(knob.tasks, released);
  };
  knobs.erase(std::remove_if(knobs.begin(), knobs.end(), is_other), knobs.end());
  return knobs;
}

Duration simulated_length(const Workload &workload) {
  Duration longest = 1;
  for (const TaskRef &ref : flatten(workload)) longest = std::max(longest, ref.task->period + ref.task->offset);
  return std::min(kMaxDuration / kPeriods, longest) * kPeriods;
}

// Searches every knob. Returns the reason for an early end, or an empty text. Results found before the end remain.
std::string search(Sensitivity &sensitivity, const std::vector<lab::Knob> &knobs, const SensitivityOptions &options,
                   AnalysisWatch &watch) {
  const analysis::AnalysisPlatform &platform = sensitivity.analysed.task_set.platform;
  const Workload &workload = sensitivity.analysed.workload;
  const lab::Accepts simulated = [&](const Workload &candidate, const analysis::TaskSet &) {
    return lab::misses_nothing(candidate, platform, sensitivity.simulated_for, &InterruptGuard::flag());
  };
  Progress &progress = watch.progress();
  lab::SensitivityOptions searching;
  searching.probes = options.probes;
  searching.stop = [&] {
    if (progress.due()) {
      const std::size_t done = sensitivity.results.size();
      const double share = static_cast<double>(done) / static_cast<double>(knobs.size());
      progress.draw(share, knob_name(sensitivity.analysed, knobs[done]) + progress.left(share));
    }
    return !watch.why_stop().empty();
  };
  for (const lab::Knob &knob : knobs) {
    KnobResult result;
    const auto margin = lab::margin_of(workload, platform, knob, lab::accepted_by_analysis, searching);
    if (!margin) return watch.why_stop();
    result.margin = *margin;
    if (options.simulate) {
      result.simulated = lab::margin_of(workload, platform, knob, simulated, searching);
      if (!result.simulated) return watch.why_stop();
    }
    sensitivity.results.push_back(std::move(result));
  }
  return {};
}

int sensitivity_of_file(const SensitivityOptions &options, Console &console) {
  const std::optional<Workload> workload = load_without_clusters(options.analysis.run, "sensitivity", console);
  if (!workload) return kExitBad;
  const InterruptGuard guard;  // covers writing the results too
  AnalysisWatch watch(options.analysis, console);
  Result<lab::Analysed> analysed =
      platform_for(*workload, options.analysis).and_then([&](const analysis::AnalysisPlatform &platform) {
        return lab::analyse(*workload, platform, "redag", watch.options());
      });
  if (!analysed) {
    console.note(analysed.error());
    return kExitBad;
  }
  const auto knobs = chosen_knobs(*analysed, options.task, console);
  if (!knobs) return kExitBad;

  Sensitivity sensitivity;
  sensitivity.analysed = *std::move(analysed);
  sensitivity.knobs = knobs->size();
  sensitivity.probes = options.probes;
  if (options.simulate) {
    sensitivity.simulated_for = options.analysis.run.duration.value_or(simulated_length(*workload));
  }
  if (const std::string why = search(sensitivity, *knobs, options, watch); !why.empty()) {
    watch.progress().clear();
    console.warn(fmt::format("{}: these are {} of {} results", why, format_count(sensitivity.results.size()),
                             format_count(knobs->size())),
                 "limit the analysis to one task or DAG with --task, or raise --time-limit");
  }
  watch.progress().clear();
  if (options.analysis.run.json) {
    console.print(to_text(to_json(sensitivity)));
  } else {
    console.say(describe(sensitivity, console.out_traits(), options.analysis.run.all_tasks));
  }
  const bool yes = sensitivity.analysed.report.verdict == analysis::Verdict::Schedulable;
  return options.analysis.run.check && !yes ? kExitNo : kExitOk;
}

}  // namespace

Action add_sensitivity(CLI::App &app) {
  auto options = std::make_shared<SensitivityOptions>();
  RunArguments &run = options->analysis.run;
  app.add_option("FILE", run.file, "Workload file (YAML); - reads standard input")->type_name("WORKLOAD")->required();
  app.add_option("--task", options->task, "Analyze one task (dag.task) or DAG only")->type_name("TASK");
  add_count(app, "--probes", options->probes, {0, kMostProbes},
            "Number of extra positions tested, to see whether acceptance is monotone");
  CLI::Option *simulate =
      app.add_flag("--simulate", options->simulate, "Also search the limit by simulation, which proves nothing");
  add_duration(app, "--duration", run.duration, "Length of each simulation (default: 20 longest periods)")
      ->needs(simulate);
  add_analysis_arguments(app, options->analysis,
                         "Exit with status 1 if the workload is not shown schedulable as it is");
  return [options](Console &console) { return sensitivity_of_file(*options, console); };
}

}  // namespace redag::cli
