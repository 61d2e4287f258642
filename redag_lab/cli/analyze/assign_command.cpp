// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include <fmt/format.h>

#include <memory>

#include "redag/base/provenance.hpp"
#include "redag/model/workload_yaml.hpp"
#include "redag_lab/cli/analyze/analysis_arguments.hpp"
#include "redag_lab/cli/analyze/assignment_report.hpp"
#include "redag_lab/cli/terminal/commands.hpp"
#include "redag_lab/cli/terminal/files.hpp"
#include "redag_lab/cli/terminal/options.hpp"
#include "redag_lab/cli/terminal/progress.hpp"
#include "redag_lab/cli/terminal/signals.hpp"

namespace redag::cli {
namespace {

enum class Keep : std::uint8_t { Nothing, Priorities, MaxActive };

struct Options {
  AnalysisArguments analysis;
  std::string output;
  Keep keep = Keep::Nothing;
  lab::AssignmentOptions assignment;
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

int assign_file(const Options &options, Console &console) {
  const std::optional<Workload> workload = load_configured(options.analysis.run, console);
  if (!workload) return kExitBad;
  if (!options.output.empty()) {
    if (const Result<void> writable = check_output(options.output); !writable) {
      console.note(writable.error());
      return kExitBad;
    }
  }
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
    console.print(describe(assigned, console.out_traits(), options.analysis.run.all_tasks));
  }
  if (!options.output.empty()) {
    const Result<void> written = write_text(
        options.output, provenance_to_comment(current_provenance()) + to_yaml(assigned.assignment.best.workload));
    if (!written) {
      console.note(written.error());
      return kExitBad;
    }
    console.note(fmt::format("wrote {}{}\n", options.output,
                             changes(assigned.assignment).empty() ? ": the unchanged workload" : ""));
  }
  return options.analysis.run.check && !assigned.assignment.best.score.schedulable ? kExitNo : kExitOk;
}

}  // namespace

Action add_assign(CLI::App &app) {
  auto options = std::make_shared<Options>();
  lab::AssignmentOptions &assignment = options->assignment;
  app.add_option("FILE", options->analysis.run.file, "Workload file (YAML); - reads standard input")->required();
  app.add_option("-o,--output", options->output, "File for the workload with the best assignment; comments are lost")
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
  add_analysis_arguments(app, options->analysis,
                         "Exit with status 1 if no assignment that was tried is shown schedulable");
  return [options](Console &console) { return assign_file(*options, console); };
}

}  // namespace redag::cli
