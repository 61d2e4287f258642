// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <memory>

#include "redag/base/text.hpp"
#include "redag/loader/validate.hpp"
#include "redag_lab/cli/analyze/tuning_report.hpp"
#include "redag_lab/cli/run/run_arguments.hpp"
#include "redag_lab/cli/terminal/commands.hpp"
#include "redag_lab/cli/terminal/files.hpp"
#include "redag_lab/cli/terminal/options.hpp"
#include "redag_lab/cli/terminal/progress.hpp"
#include "redag_lab/cli/terminal/signals.hpp"

namespace redag::cli {
namespace {

constexpr std::uint32_t kMostSeeds = 10'000;
const std::vector<std::string> kSettings = {"workers", "max_active", "priorities"};

struct TuneOptions {
  RunArguments run;
  lab::TuneOptions tune;
  std::string output;
  std::string vary;  // empty: as the judge has it
  std::string caps;
  bool all_trials = false;
};

// Parses "workers,max_active", the settings that may change. Returns false after printing an error.
bool parse_vary(const std::string &list, lab::Freedom &freedom, Console &console) {
  freedom.workers = freedom.caps = freedom.priorities = false;
  std::size_t begin = 0;
  while (begin <= list.size()) {
    const std::size_t end = std::min(list.find(',', begin), list.size());
    const std::string name = list.substr(begin, end - begin);
    if (name == "workers") {
      freedom.workers = true;
    } else if (name == "max_active") {
      freedom.caps = true;
    } else if (name == "priorities") {
      freedom.priorities = true;
    } else {
      console.error(fmt::format("--vary: {} is not a valid choice", in_quotes(name)), suggestion(name, kSettings));
      return false;
    }
    begin = end + 1;
  }
  return true;
}

// Parses "2-5". Returns false after printing an error.
bool parse_caps(const std::string &text, lab::Freedom &freedom, Console &console) {
  if (text.empty()) return true;
  std::uint32_t low = 0;
  std::uint32_t high = 0;
  const char *end = text.data() + text.size();
  const auto first = std::from_chars(text.data(), end, low);
  if (first.ec == std::errc() && first.ptr != end && *first.ptr == '-') {
    const auto second = std::from_chars(first.ptr + 1, end, high);
    if (second.ec == std::errc() && second.ptr == end && low >= 1 && low <= high && high <= kMaxBound) {
      freedom.cap_range = {low, high};
      return true;
    }
  }
  console.error(fmt::format("--caps: {} is not a range within 1-{}", in_quotes(text), kMaxBound), "write it as 2-5");
  return false;
}

std::optional<lab::Tuned> search(const Workload &workload, lab::TuneOptions options, Console &console) {
  Progress progress(console);
  options.stop = &InterruptGuard::flag();
  options.progress = [&](std::uint64_t tried) {
    if (!progress.due()) return;
    progress.draw(0, fmt::format("{} settings", format_count(tried)));
  };
  return lab::tune(workload, options);
}

int tune_file(const TuneOptions &options, Console &console) {
  Tuning tuning;
  tuning.options = options.tune;
  const bool by_bounds = options.tune.judge == lab::Judge::Bounds;
  if (by_bounds) tuning.options.held_out = 0;
  tuning.options.seed = options.run.seed;
  if (options.run.seed + options.tune.seeds + options.tune.held_out < options.run.seed) {
    console.error("--seed, --seeds and --held-out: the last seed is not below 2^64", "choose a smaller first seed");
    return kExitBad;
  }
  tuning.options.simulation.overheads = options.run.overheads;
  const std::string usual = by_bounds ? "max_active,priorities" : "workers,max_active";
  if (!parse_vary(options.vary.empty() ? usual : options.vary, tuning.options.freedom, console) ||
      !parse_caps(options.caps, tuning.options.freedom, console)) {
    return kExitBad;
  }
  std::string source;
  const std::optional<Workload> workload = load_without_clusters(options.run, "tune", console, &source);
  if (!workload) return kExitBad;
  if (!options.output.empty() && !ok(check_output(options.output), console)) return kExitBad;
  if (options.run.calibration) {
    const Result<Overheads> machine = options.run.calibration->of(is_realtime(workload->platform.preemption));
    if (!ok(machine, console)) return kExitBad;
    tuning.options.machine = *machine;
    tuning.options.simulation.overheads = sim::overheads_of(*machine);
  }
  if (by_bounds) {
    const Result<analysis::TaskSet> task_set = analysis::compile(*workload, analysis::platform_of(*workload));
    if (!ok(task_set, console)) return kExitBad;
  }
  tuning.options.simulation.duration = options.run.duration.value_or(lab::sensible_duration(*workload));

  const InterruptGuard guard;  // covers writing the results too
  std::optional<lab::Tuned> tuned = search(*workload, tuning.options, console);
  if (!tuned) {
    console.error("interrupted before the present workload was judged: there is no result");
    return kExitBad;
  }
  tuning.tuned = *std::move(tuned);
  if (tuning.tuned.stopped) console.warn("interrupted: this is the best setting found so far");
  if (options.run.json) {
    console.print(to_text(to_json(tuning)));
  } else {
    console.say(describe(tuning, console.out_traits(), options.all_trials));
  }
  const lab::SettingCandidate &best = tuning.tuned.best;
  if (!write_changed(options.output, source, best.workload, console)) return kExitBad;
  const bool holds = by_bounds ? best.score.proven : best.score.missed + best.held_out.missed == 0;
  return options.run.check && !holds ? kExitNo : kExitOk;
}

}  // namespace

Action add_tune(CLI::App &app) {
  auto options = std::make_shared<TuneOptions>();
  lab::TuneOptions &tune = options->tune;
  app.add_option("FILE", options->run.file, "Workload file (YAML); - reads standard input")
      ->type_name("WORKLOAD")
      ->required();
  app.add_option("-o,--output", options->output, "File for the tuned workload: FILE with its changes")
      ->type_name("FILE");
  add_choice(
      app, "--judge", tune.judge, choices_of(std::array{lab::Judge::Simulation, lab::Judge::Bounds}),
      "What decides which setting is better: the misses in simulated runs, or the bounds of 'redag analyze' alone")
      ->default_str(to_string(tune.judge));
  app.add_option("--vary", options->vary,
                 "What may change: workers, max_active, priorities; by default workers,max_active, or "
                 "max_active,priorities with the bounds as judge")
      ->type_name("LIST");
  app.add_option("--caps", options->caps,
                 "Values of max_active to try for every DAG (default: none, and all values that can matter)")
      ->type_name("LOW-HIGH");
  add_count(app, "--most-workers", tune.freedom.most_workers, {0, kMaxWorkers},
            "Try at most this many workers; 0: as many as there are");
  add_duration(app, "--duration", options->run.duration, "Length of a simulation (default: some hyperperiods)");
  add_count(app, "--seeds", tune.seeds, {1, kMostSeeds}, "Simulations of each setting, with seeds SEED, SEED+1, ...");
  add_count(app, "--held-out", tune.held_out, {0, kMostSeeds},
            "Number of unseen seeds for the validation of the result");
  add_seed(app, options->run.seed, "First seed");
  add_count(app, "--jobs", tune.jobs, {0, kMaxJobs}, "Processors to use; 0: all. The result does not depend on it");
  app.add_flag("--all-trials", options->all_trials, "Show every setting that was tried");
  app.add_flag("--json", options->run.json, "Write one JSON document, and nothing else, to standard output");
  app.add_flag(
      "--check", options->run.check,
      "Exit with status 1 if the best setting misses a deadline in simulation, or is not shown to meet them all");
  add_platform_arguments(app, options->run);
  add_overhead_arguments(app, options->run, "Platform");
  return [options](Console &console) { return tune_file(*options, console); };
}

}  // namespace redag::cli
