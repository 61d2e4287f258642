// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include <fmt/format.h>
#include <spawn.h>
#include <sys/wait.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <memory>
#include <system_error>

#include "redag/base/text.hpp"
#include "redag/trace/output_file.hpp"
#include "redag_lab/cli/experiment/experiment_run.hpp"
#include "redag_lab/cli/experiment/experiment_studies.hpp"
#include "redag_lab/cli/terminal/files.hpp"
#include "redag_lab/cli/terminal/options.hpp"
#include "redag_lab/cli/terminal/signals.hpp"
#include "redag_lab/experiment/folder.hpp"
#include "redag_lab/experiment/slurm.hpp"
#include "redag_lab/experiment/unit_cost.hpp"

namespace redag::cli {
namespace {

namespace fs = std::filesystem;

constexpr std::uint32_t kMostShards = 1000;      // of Slurm's default MaxArraySize
constexpr std::uint32_t kMostMinutes = 60 * 24;  // of a shard
constexpr int kTimeMargin = 4;  // from a shard's expected time to its limit: nodes differ, and units do

struct Settings {
  std::string plan;
  Duration sample = 10 * kSecond;
  StudyOutput output;
  bool slurm = false;
  bool now = false;
  std::uint32_t shards = 0;  // 0: by minutes
  std::uint32_t minutes = 10;
  std::uint32_t cpus = 1;
};

std::unique_ptr<Study> load_study(const std::string &file, Console &console) {
  const Result<std::string> text = trace::read_file(file);
  if (!text) {
    console.note(text.error());
    return nullptr;
  }
  std::unique_ptr<Study> study = make_study(*text, file, console);
  if (study != nullptr && study->takes_turns()) {
    console.error(
        fmt::format("{}: runs on threads or under ROS 2 depend on one machine, and take their duration", file),
        "only simulated experiments can be shared");
    return nullptr;
  }
  return study;
}

// Measures and prints the cost. Returns nothing after an error or Ctrl-C.
std::optional<experiment::UnitCost> measure(const Study &study, Duration effort, Console &console) {
  const InterruptGuard guard;
  const Result<experiment::UnitCost> cost = experiment::measure_cost(
      study.unit_count(), effort, [&study](std::uint64_t unit) { return study.evaluate(unit); },
      experiment::thread_time, InterruptGuard::flag());
  if (InterruptGuard::interrupted()) {
    console.error("interrupted before the cost was measured");
    return std::nullopt;
  }
  if (!cost) {
    console.note(cost.error());
    return std::nullopt;
  }
  const double hours = cost->mean * static_cast<double>(study.unit_count()) / 1e9 / 3600;
  const auto time = [](double value) { return humanize_duration(std::llround(value)); };
  console.say(fmt::format("{} {}, {} each (+- {}; {} of them measured): {:.3g} hours of a processor like this one\n",
                          format_count(study.unit_count()), study.units_are(), time(cost->mean), time(cost->error),
                          format_count(cost->measured), hours));
  return *cost;
}

CLI::Option *add_sample(CLI::App &app, Settings &settings) {
  return add_duration(app, "--sample", settings.sample, "Processor time for measuring what a unit costs");
}

bool write(const std::string &folder, const experiment::SlurmScript &script, Console &console) {
  const Result<void> written = write_text(folder + "/" + script.name, script.text);
  if (!written) console.note(written.error());
  return written.has_value();
}

// Runs the script that submits. Its output is that of sbatch.
int submit_now(const std::string &script, Console &console) {
  std::string shell = "sh";
  std::string file = script;
  char *arguments[] = {shell.data(), file.data(), nullptr};
  pid_t child = 0;
  const int error = ::posix_spawnp(&child, "sh", nullptr, nullptr, arguments, environ);
  int status = 0;
  if (error != 0 || ::waitpid(child, &status, 0) != child) {
    console.error(fmt::format("{}: cannot run: {}", script, std::strerror(error != 0 ? error : errno)));
    return kExitBad;
  }
  if (WIFEXITED(status) && WEXITSTATUS(status) == 0) return kExitOk;
  console.error(fmt::format("{}: Slurm did not take the jobs", script),
                fmt::format("'sh {} --partition=NAME' passes options to sbatch", script));
  return kExitBad;
}

// Decides on the shards and writes the folder: the plan, the scripts last.
bool write_jobs(const Study &study, const Settings &settings, Console &console) {
  std::uint32_t shards = settings.shards;
  Duration time = Duration{settings.minutes} * 60 * kSecond;  // of a shard
  if (shards == 0) {
    const std::optional<experiment::UnitCost> cost = measure(study, settings.sample, console);
    if (!cost) return false;
    const double total = cost->mean * static_cast<double>(study.unit_count()) / settings.cpus;
    const double wanted = std::ceil(total / static_cast<double>(time));
    shards = static_cast<std::uint32_t>(std::clamp(wanted, 1.0, static_cast<double>(kMostShards)));
    time = std::max<Duration>(kSecond, std::llround(total / shards));
    console.say(fmt::format("shards take about {} on {} processor{} each\n", humanize_duration(time), settings.cpus,
                            settings.cpus == 1 ? "" : "s"));
  }
  shards = static_cast<std::uint32_t>(std::min<std::uint64_t>(shards, study.unit_count()));
  std::error_code failed;
  const fs::path program = fs::read_symlink("/proc/self/exe", failed);
  const std::string &folder = settings.output.folder;
  std::vector<experiment::SlurmScript> scripts =
      experiment::slurm_scripts({.program = failed ? std::string("redag") : program.string(),
                                 .experiment = study.command(),
                                 .name = fs::path(folder).filename().string(),
                                 .shards = shards,
                                 .cpus = settings.cpus,
                                 .time = time * kTimeMargin});
  scripts.push_back({"plan.yaml", study.plan()});
  std::reverse(scripts.begin(), scripts.end());  // a folder with kSubmitScript is whole
  for (const experiment::SlurmScript &script : scripts) {
    if (!write(folder, script, console)) return false;
  }
  console.say(fmt::format("{}: {} shard{}, and a job that merges them\n", folder, shards, shards == 1 ? "" : "s"));
  return true;
}

int submit(const Settings &settings, Console &console) {
  if (!settings.slurm) {
    console.error("which cluster? only Slurm is known", "add --slurm");
    return kExitBad;
  }
  const std::unique_ptr<Study> study = load_study(settings.plan, console);
  if (study == nullptr) return kExitBad;
  const std::string &folder = settings.output.folder;
  const std::string script = folder + "/" + experiment::kSubmitScript;
  if (const Result<void> ready = prepare_folder(folder, settings.output.force); !ready) {
    console.note(ready.error());
    return kExitBad;
  }
  if (const Result<void> same = experiment::expect_plan_of(folder, study->plan()); !same) {
    console.note(same.error());
    return kExitBad;
  }
  if (fs::exists(script)) {
    console.say(fmt::format("{} holds the jobs of this plan already; they go on where they ended\n", folder));
  } else if (!write_jobs(*study, settings, console)) {
    return kExitBad;
  }
  if (settings.now) return submit_now(script, console);
  console.print(fmt::format("submit them with: sh {}\n", script));
  return kExitOk;
}

}  // namespace

Action add_cost(CLI::App &app) {
  const auto settings = std::make_shared<Settings>();
  app.add_option("PLAN", settings->plan, "Plan of an experiment (YAML)")->type_name("PLAN")->required();
  add_sample(app, *settings);
  app.footer(
      "Examples:\n"
      "  redag experiment cost experiments/acceptance_dags.yaml\n"
      "  redag experiment cost experiments/paper/factorial.yaml --sample 60s\n");
  return [settings](Console &console) {
    const std::unique_ptr<Study> study = load_study(settings->plan, console);
    return study != nullptr && measure(*study, settings->sample, console) ? kExitOk : kExitBad;
  };
}

Action add_submit(CLI::App &app) {
  const auto settings = std::make_shared<Settings>();
  app.add_option("PLAN", settings->plan, "Plan of an experiment (YAML)")->type_name("PLAN")->required();
  app.add_option("--out", settings->output.folder,
                 "Folder for the jobs and all results, which all nodes can reach; the same folder goes on")
      ->type_name("DIR")
      ->required();
  app.add_flag("--force", settings->output.force, "Write into a folder that holds other files");
  app.add_flag("--slurm", settings->slurm, "Write an array job with a task for each shard, and a job that merges them");
  app.add_flag("--now", settings->now, "Submit the jobs, too");
  CLI::Option *shards = add_count(app, "--shards", settings->shards, {1, 1'000'000},
                                  "Number of shards (default: by --minutes, at most 1000)");
  shards->default_str("");
  add_count(app, "--minutes", settings->minutes, {1, kMostMinutes}, "Time that a shard should take");
  add_count(app, "--cpus", settings->cpus, {1, kMaxJobs}, "Processors of a task");
  add_sample(app, *settings)->excludes(shards);
  app.footer(
      "Examples:\n"
      "  redag experiment submit experiments/acceptance_dags.yaml --slurm --out dags\n"
      "  redag experiment submit experiments/paper/factorial.yaml --slurm --now --out f\n");
  return [settings](Console &console) { return submit(*settings, console); };
}

}  // namespace redag::cli
