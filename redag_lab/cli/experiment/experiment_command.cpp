// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include <algorithm>
#include <filesystem>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "redag/trace/events_file.hpp"
#include "redag/version.hpp"
#include "redag_lab/cli/experiment/experiment_run.hpp"
#include "redag_lab/cli/experiment/experiment_studies.hpp"
#include "redag_lab/cli/terminal/commands.hpp"
#include "redag_lab/cli/terminal/files.hpp"
#include "redag_lab/cli/terminal/json.hpp"
#include "redag_lab/experiment/factorial_recorded.hpp"

namespace redag::cli {
namespace {

struct MergeSettings {
  std::vector<std::string> folders;
  StudyOutput output;
};

// Merges recorded runs into their experiment's results.
Result<MergedUnits> add_recorded(MergedUnits merged, const std::vector<std::string> &places) {
  Result<experiment::FactorialPlan> plan =
      experiment::parse_factorial_plan(merged.plan, merged.plan_file, executors_of);
  if (!plan) return tl::unexpected<Diagnostics>(std::move(plan.error()));
  std::vector<experiment::RecordedRun> runs;
  for (const std::string &place : places) {
    const Result<std::vector<std::string>> traces = find_traces(place);
    if (!traces) return tl::unexpected<Diagnostics>(traces.error());
    for (const std::string &file : *traces) {
      const Result<trace::Trace> trace = trace::read_trace(file);
      if (!trace) return tl::unexpected<Diagnostics>(trace.error());
      if (trace->info.driver == trace::Driver::Ros) continue;  // the scheduler's trace; the nodes' one counts
      runs.push_back(experiment::record(file, *trace, *plan));
    }
  }
  std::vector<experiment::FinishedUnit> units;
  const Result<void> read = merged.visit([&units](std::uint64_t unit, const std::string &result) -> Result<void> {
    units.push_back({unit, result});
    return {};
  });
  if (!read) return tl::unexpected<Diagnostics>(read.error());
  Result<experiment::FactorialUnits> all = experiment::with_recorded({std::move(*plan), std::move(units)}, runs);
  if (!all) return tl::unexpected<Diagnostics>(std::move(all.error()));
  merged.plan = to_yaml(all->plan);
  merged.visit = [units = std::move(all->units)](const experiment::Accept &accept) -> Result<void> {
    for (const experiment::FinishedUnit &unit : units) {
      if (Result<void> accepted = accept(unit.unit, unit.result); !accepted) return accepted;
    }
    return {};
  };
  for (const experiment::RecordedRun &run : runs) {
    const trace::Machine &machine = run.info.machine;
    merged.runs.push_back(Json{
        {"event", "recorded"},
        {"file", run.file},
        {"machine", {{"cpus", machine.cpus}, {"kernel", machine.kernel}, {"model", machine.model}}},
        {"provenance", Json::parse(provenance_to_json(run.info.provenance))},
        {"version", kVersion},
        {"jobs", 1}}.dump(-1, ' ', false, Json::error_handler_t::replace));
  }
  return merged;
}

// Merges folders. Those without a plan hold recorded runs.
int merge(const MergeSettings &settings, Console &console) {
  std::vector<std::string> experiments;
  std::vector<std::string> recorded;
  for (const std::string &folder : settings.folders) {
    const bool has_plan = std::filesystem::exists(folder + "/plan.yaml");
    const bool has_runs = !has_plan && find_traces(folder).has_value();
    (has_runs ? recorded : experiments).push_back(folder);
  }
  if (experiments.empty()) {
    console.error("recorded runs alone are not an experiment",
                  "also name the folder of the experiment that they belong to");
    return kExitBad;
  }
  Result<MergedUnits> merged = read_merged(experiments);
  if (merged && !recorded.empty()) merged = add_recorded(std::move(*merged), recorded);
  if (!merged) {
    console.note(merged.error());
    return kExitBad;
  }
  return merge_studies(*merged, settings.output, make_study, console);
}

Action add_merge(CLI::App &app) {
  const auto settings = std::make_shared<MergeSettings>();
  app.add_option("DIR", settings->folders,
                 "Folders of the shards (--out) of one plan; and of run_workload, whose runs are added")
      ->type_name("DIR")
      ->required();
  add_study_output(app, settings->output, "-o,--out", "Folder for the merged results")->required();
  app.footer(
      "Examples:\n"
      "  redag experiment merge results/dags-1 results/dags-2 --out results/dags\n"
      "  redag experiment merge results/simulated results/ros --out results/both\n");
  return [settings](Console &console) { return merge(*settings, console); };
}

}  // namespace

// A plan's key stands at the begin of a line. Its reader reports mistakes in the plan.
std::unique_ptr<Study> make_study(const std::string &plan, const std::string &file, Console &console) {
  const std::string lines = "\n" + plan;
  return lines.find("\nexperiment: factorial") != std::string::npos ? make_factorial(plan, file, console)
                                                                    : make_acceptance(plan, file, console);
}

Action add_experiment(CLI::App &app) {
  app.require_subcommand(1);
  CLI::App *acceptance =
      app.add_subcommand("acceptance", "Measure the share of random workloads that the bounds accept");
  CLI::App *factorial = app.add_subcommand("factorial", "Run every executor on every combination of factors");
  CLI::App *together = app.add_subcommand("merge", "Merge the shards of several machines");
  CLI::App *price = app.add_subcommand("cost", "Measure what a plan costs in hours of a processor");
  CLI::App *submit = app.add_subcommand("submit", "Write the jobs that run a plan on a cluster, and submit them");
  const std::vector<std::pair<CLI::App *, Action>> actions = {{acceptance, add_acceptance(*acceptance)},
                                                              {factorial, add_factorial(*factorial)},
                                                              {together, add_merge(*together)},
                                                              {price, add_cost(*price)},
                                                              {submit, add_submit(*submit)}};
  return [actions](Console &console) {
    const auto chosen =
        std::find_if(actions.begin(), actions.end(), [](const auto &action) { return action.first->parsed(); });
    return chosen->second(console);
  };
}

}  // namespace redag::cli
