// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include <fmt/format.h>

#include <memory>

#include "redag/loader/validate.hpp"
#include "redag/loader/workload_yaml.hpp"
#include "redag_lab/cli/terminal/commands.hpp"
#include "redag_lab/cli/terminal/files.hpp"
#include "redag_lab/cli/terminal/options.hpp"
#include "redag_lab/workload/generate.hpp"

namespace redag::cli {
namespace {

struct GenerateOptions {
  lab::GenerateOptions generate;
  std::uint64_t seed = 1;
  std::string file;
};

constexpr double kLeastShare = 1e-9;  // minimum of options that must be above 0

void add_structure(CLI::App &app, lab::GenerateOptions &g) {
  const std::string group = "DAGs";
  add_count(app, "--dags", g.dags, {1, lab::kMaxTasks}, "Number of DAGs")->group(group);
  add_count(app, "--min-tasks", g.min_tasks, {1, lab::kMaxTasks}, "Fewest tasks of a DAG")->group(group);
  add_count(app, "--max-tasks", g.max_tasks, {1, lab::kMaxTasks}, "Most tasks of a DAG")->group(group);
  add_choice(app, "--shape", g.shape, choices_of(lab::kDagShapes), "Structure of the edges")
      ->default_str(to_string(g.shape))
      ->group(group);
}

void add_timing(CLI::App &app, lab::GenerateOptions &g) {
  const std::string group = "Time";
  add_number(app, "--utilization", g.utilization, {kLeastShare, lab::kMaxTasks}, "Total utilization of all tasks")
      ->group(group);
  add_choice(app, "--periods", g.periods, choices_of(lab::kPeriodModels), "Distribution of periods")
      ->default_str(to_string(g.periods))
      ->group(group);
  add_duration(app, "--period-min", g.period_min, "Shortest period (log_uniform, harmonic)")->group(group);
  add_duration(app, "--period-max", g.period_max, "Longest period (log_uniform, harmonic)")->group(group);
  app.add_flag("--offsets", g.offsets, "Give timer tasks random offsets below their periods")->group(group);
}

void add_platform(CLI::App &app, lab::GenerateOptions &g) {
  const std::string group = "Platform";
  add_count(app, "--workers", g.workers, {1, kMaxWorkers}, "Number of workers")->group(group);
  add_choice(app, "--preemption", g.preemption, choices_of<PreemptionMode>(), "Preemption mode")
      ->default_str(to_string(g.preemption))
      ->group(group);
}

// Returns the command that generates this workload again, as a comment for its first line.
std::string provenance(const CLI::App &app, std::uint64_t seed) {
  std::string line = "# redag generate";
  for (const CLI::Option *option : app.get_options()) {
    const std::string name = option->get_name();
    if (option->count() == 0 || name == "--seed" || name == "--output") continue;
    line += " " + name;
    if (option->get_expected_min() > 0) line += " " + option->results().back();
  }
  return line + fmt::format(" --seed {}\n", seed);
}

int generate_workload(const CLI::App &app, const GenerateOptions &options, Console &console) {
  const Result<Workload> workload = generate(options.generate, options.seed);
  if (!ok(workload, console)) return kExitBad;
  const std::string text = provenance(app, options.seed) + to_yaml(*workload);
  if (options.file.empty()) {
    console.print(text);
    return kExitOk;
  }
  const Result<void> written = check_output(options.file).and_then([&] { return write_text(options.file, text); });
  if (!ok(written, console)) return kExitBad;
  console.note(fmt::format("wrote {}\n", options.file));
  return kExitOk;
}

}  // namespace

Action add_generate(CLI::App &app) {
  auto options = std::make_shared<GenerateOptions>();
  add_seed(app, options->seed, "Seed; the same options and seed give the same workload everywhere");
  app.add_option("-o,--output", options->file, "File to write (default: standard output)")->type_name("FILE");
  add_structure(app, options->generate);
  add_timing(app, options->generate);
  add_platform(app, options->generate);
  return [options, &app](Console &console) { return generate_workload(app, *options, console); };
}

}  // namespace redag::cli
