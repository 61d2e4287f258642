// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include <fmt/format.h>

#include <memory>

#include "redag_lab/cli/analyze/analysis_arguments.hpp"
#include "redag_lab/cli/analyze/assignment_report.hpp"
#include "redag_lab/cli/analyze/placement_report.hpp"
#include "redag_lab/cli/terminal/commands.hpp"
#include "redag_lab/cli/terminal/files.hpp"
#include "redag_lab/cli/terminal/options.hpp"
#include "redag_lab/cli/terminal/progress.hpp"
#include "redag_lab/cli/terminal/signals.hpp"

namespace redag::cli {
namespace {

enum class Keep : std::uint8_t { Nothing, Priorities, MaxActive };

struct AssignOptions {
  AnalysisArguments analysis;
  std::string output;
  Keep keep = Keep::Nothing;
  lab::AssignmentOptions assignment;
  std::vector<const CLI::Option *> of_search;  // options that have no meaning with clusters
};

Result<lab::Assignment> search(const Workload &workload, const analysis::AnalysisPlatform &platform,
                               lab::AssignmentOptions options, AnalysisWatch &watch) {
  Progress &progress = watch.progress();
  std::uint64_t asked = 0;
  options.stop = [&] {
    ++asked;
    if (progress.due()) progress.draw(0, fmt::format("{} assignments", asked));
    return !watch.why_stop().empty();
  };
  Result<lab::Assignment> found = lab::assign(workload, platform, options);
  progress.clear();
  return found;
}

// With clusters: finds the clusters of the DAGs that name none.
int assign_clusters(const Workload &workload, const std::string &source, const AssignOptions &options,
                    Console &console) {
  for (const CLI::Option *option : options.of_search) {
    if (option->count() == 0) continue;
    console.error(fmt::format("{}: 'assign' only chooses clusters for a workload with clusters", option->get_name()),
                  "leave it out");
    return kExitBad;
  }
  const Result<analysis::AnalysisPlatform> platform = platform_for(workload, options.analysis);
  if (!platform) {
    console.note(platform.error());
    return kExitBad;
  }
  const InterruptGuard guard;  // covers writing the results too
  AnalysisWatch watch(options.analysis, console);
  const Result<lab::Placement> placement =
      lab::place(workload, *platform, [&watch] { return !watch.why_stop().empty(); });
  if (!placement) {
    console.note(placement.error());
    return kExitBad;
  }
  if (placement->stopped) console.warn(watch.why_stop() + ": not every DAG has been placed");
  if (options.analysis.run.json) {
    console.print(to_text(to_json(*placement)));
  } else {
    console.say(describe(*placement, console.out_traits()));
  }
  if (!placement->left_over.empty()) return kExitNo;
  if (!write_changed(options.output, source, placement->workload, console)) return kExitBad;
  return options.analysis.run.check && !placement->is_schedulable() ? kExitNo : kExitOk;
}

int assign_file(const AssignOptions &options, Console &console) {
  std::string source;
  const std::optional<Workload> workload =
      load_configured(options.analysis.run, console, {.cluster_optional = true, .waits = true}, "assign", &source);
  if (!workload) return kExitBad;
  if (!options.output.empty()) {
    if (const Result<void> writable = check_output(options.output); !writable) {
      console.note(writable.error());
      return kExitBad;
    }
  }
  if (!workload->platform.clusters.empty()) return assign_clusters(*workload, source, options, console);
  Assigned assigned;
  const Result<analysis::AnalysisPlatform> platform = platform_for(*workload, options.analysis);
  if (!platform) {
    console.note(platform.error());
    return kExitBad;
  }
  assigned.platform = *platform;
  assigned.options = options.assignment;
  assigned.options.priorities = options.keep != Keep::Priorities;
  assigned.options.caps = options.keep != Keep::MaxActive;
  const InterruptGuard guard;  // covers writing the results too
  AnalysisWatch watch(options.analysis, console);
  Result<lab::Assignment> found = search(*workload, assigned.platform, assigned.options, watch);
  if (!found) {
    console.note(found.error());
    return kExitBad;
  }
  assigned.assignment = *std::move(found);
  if (assigned.assignment.stopped) console.warn(watch.why_stop() + ": this is the best assignment found so far");
  if (options.analysis.run.json) {
    console.print(to_text(to_json(assigned)));
  } else {
    console.say(describe(assigned, console.out_traits(), options.analysis.run.all_tasks));
  }
  if (!write_changed(options.output, source, assigned.assignment.best.workload, console)) return kExitBad;
  return options.analysis.run.check && !assigned.assignment.best.score.schedulable ? kExitNo : kExitOk;
}

}  // namespace

Action add_assign(CLI::App &app) {
  auto options = std::make_shared<AssignOptions>();
  lab::AssignmentOptions &assignment = options->assignment;
  app.add_option("FILE", options->analysis.run.file, "Workload file (YAML); - reads standard input")
      ->type_name("WORKLOAD")
      ->required();
  app.add_option("-o,--output", options->output,
                 "File for the workload with the best assignment: FILE with its changes")
      ->type_name("FILE");
  add_choice(
      app, "--objective", assignment.objective, choices_of(std::array{lab::Objective::Lateness, lab::Objective::Slack}),
      "Minimise the largest bound - deadline (lateness), or maximise the smallest share of a deadline that is left "
      "(slack)")
      ->default_str(to_string(assignment.objective));
  add_choice(
      app, "--keep", options->keep,
      Choices<Keep>{{"nothing", Keep::Nothing}, {"priorities", Keep::Priorities}, {"max_active", Keep::MaxActive}},
      "What to keep as it is")
      ->default_str("nothing");
  add_count(app, "--exhaustive", assignment.exhaustive, {0, kMaxCombinations},
            "Try all combinations of max_active up to this number; above, search locally");
  add_count(app, "--restarts", assignment.restarts, {0, kMaxRestarts},
            "Number of random starting points of the local search");
  add_seed(app, assignment.seed, "Seed of these starting points; the same seed gives the same result");
  for (const char *name : {"--objective", "--keep", "--exhaustive", "--restarts", "--seed"}) {
    options->of_search.push_back(&option_named(app, name));
  }
  add_analysis_arguments(app, options->analysis,
                         "Exit with status 1 if no assignment that was tried is shown schedulable");
  return [options](Console &console) { return assign_file(*options, console); };
}

}  // namespace redag::cli
