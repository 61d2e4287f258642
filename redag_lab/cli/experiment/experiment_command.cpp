// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include <fmt/format.h>

#include <algorithm>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "redag/base/check.hpp"
#include "redag/base/text.hpp"
#include "redag/trace/this_machine.hpp"
#include "redag_analysis/text/words.hpp"
#include "redag_lab/cli/terminal/commands.hpp"
#include "redag_lab/cli/terminal/files.hpp"
#include "redag_lab/cli/terminal/options.hpp"
#include "redag_lab/cli/terminal/progress.hpp"
#include "redag_lab/cli/terminal/signals.hpp"
#include "redag_lab/experiment/load.hpp"
#include "redag_lab/experiment/unit_store.hpp"
#include "redag_lab/run/ros2_run.hpp"
#include "redag_lab/run/session.hpp"
#include "redag_lab/run/variant.hpp"

namespace redag::cli {
namespace {

using experiment::FinishedRun;
using experiment::LoadedExperiment;
using experiment::PlannedRun;
using experiment::UnitStore;
using experiment::World;

struct Settings {
  std::string plan;
  std::string folder;
  std::string run_workload;
  std::uint32_t jobs = 0;  // 0: one per processor
};

/// Executes a run in any world; `program` is the one for ROS 2.
Result<FinishedRun> drive(const PlannedRun &planned, const std::string &program) {
  if (planned.world == World::Ros2) return lab::run_in_ros2(planned, program, InterruptGuard::flag());
  const Result<lab::Variant> variant = lab::parse_variant(planned.executor);
  REDAG_CHECK(variant.has_value(), "the plan was checked");
  lab::SessionOptions options;
  options.driver = planned.world == World::Simulator ? trace::Driver::Simulator : trace::Driver::Threads;
  options.duration = planned.duration;
  options.warm_up = planned.warm_up;
  options.seed = planned.seed;
  options.overheads = planned.overheads;
  options.stop = &InterruptGuard::flag();
  Result<lab::Session> session = lab::run_session(planned.workload, *variant, options);
  if (!session) return tl::unexpected<Diagnostics>(std::move(session.error()));
  if (session->stopped) return make_error("interrupted");
  if (session->cut_at) {
    return make_error(fmt::format("a run has more than {} events, which cannot be checked", options.max_events),
                      "make 'duration' shorter");
  }
  return FinishedRun{std::move(session->trace), std::move(session->summary), std::move(session->check)};
}

/// Runs the units that the folder does not have yet.
class Run {
 public:
  Run(LoadedExperiment loaded, const Settings &settings, Console &console)
      : loaded_(std::move(loaded)),
        experiment_(*loaded_.experiment),
        settings_(settings),
        console_(console),
        done_(experiment_.unit_count()) {}

  int run() {
    if (!ok(prepare_folder(settings_.folder), console_)) return kExitBad;
    const auto known = [this](std::uint64_t unit, const std::string &result) -> Result<void> {
      if (unit < done_.size() && done_[unit]) return {};
      if (Result<void> added = experiment_.add(unit, result); !added) return added;
      done_[unit] = true;
      return {};
    };
    Result<UnitStore> store = UnitStore::open(settings_.folder, loaded_.subject, known);
    if (!ok(store, console_)) return kExitBad;
    const InterruptGuard guard;  // covers writing the results too
    const bool good = work(*store);
    // Finished units are kept and shown even if the others failed.
    if (InterruptGuard::interrupted()) {
      console_.note("interrupted: the results so far are kept; run the same command to resume\n");
    }
    const int status = show();
    return good ? status : kExitBad;
  }

 private:
  bool work(UnitStore &store) {
    std::vector<std::uint64_t> units;
    for (std::uint64_t unit = 0; unit < done_.size(); ++unit) {
      if (!done_[unit]) units.push_back(unit);
    }
    const auto found = static_cast<std::uint64_t>(std::count(done_.begin(), done_.end(), true));
    if (found > 0) console_.note(fmt::format("{} of {} units are done already\n", found, done_.size()));
    if (units.empty()) return true;
    std::uint32_t jobs = settings_.jobs > 0 ? settings_.jobs : std::max(1U, trace::this_machine().cpus);
    if (experiment_.takes_turns()) {
      if (const auto busy = lab::busy_machine_warning()) console_.warn(*busy);
      experiment_.arrange(units);
      jobs = 1;
    }
    Progress progress(console_);
    std::uint64_t finished = 0;
    const auto accept = [&](std::uint64_t unit, const std::string &result) -> Result<void> {
      if (Result<void> kept = store.append(unit, result); !kept) return kept;
      ++finished;
      if (progress.due()) {
        const double done = static_cast<double>(finished) / static_cast<double>(units.size());
        progress.draw(done, fmt::format("{} of {} units{}", finished, units.size(), progress.left(done)));
      }
      return experiment_.add(unit, result);
    };
    const Result<void> ran = experiment::run_units(
        units, jobs, InterruptGuard::flag(), [this](std::uint64_t unit) { return experiment_.evaluate(unit); }, accept);
    progress.clear();
    // A unit that Ctrl-C interrupted has no result, and this is no error.
    const bool good = InterruptGuard::interrupted() || ok(ran, console_);
    console_.note(fmt::format("{} of {} units in {} on {}\n", finished, units.size(),
                              humanize_duration(progress.elapsed()), plural(jobs, "processor")));
    return ok(store.sync(), console_) && good;
  }

  // Writes the files, says what was checked, and judges.
  int show() {
    Result<experiment::Results> results = experiment_.results();
    if (!ok(results, console_)) return kExitBad;
    if (!ok(write_text(settings_.folder + "/results.csv", to_csv(*results)), console_) ||
        !ok(write_text(settings_.folder + "/results.json", to_json(*results, loaded_.plan)), console_)) {
      return kExitBad;
    }
    console_.say(fmt::format("{} of {} {} are done\n", format_count(results->done), format_count(results->units),
                             results->units_are));
    for (const experiment::Remark &remark : results->remarks) {
      remark.good ? console_.say(remark.text + "\n") : console_.error(remark.text);
    }
    console_.say(fmt::format("{0}/results.csv has all figures with their intervals; 'redag report {0}' draws them\n",
                             settings_.folder));
    return results->all_good() ? kExitOk : kExitNo;
  }

  LoadedExperiment loaded_;
  experiment::Experiment &experiment_;
  const Settings &settings_;
  Console &console_;
  std::vector<bool> done_;
};

std::vector<std::string> executors_of(World world) {
  return world == World::Ros2 ? lab::ros2_executors() : lab::variant_names();
}

}  // namespace

Action add_experiment(CLI::App &app) {
  const auto settings = std::make_shared<Settings>();
  app.add_option("PLAN", settings->plan, "Plan (YAML, see docs/experiments.md)")->type_name("PLAN")->required();
  app.add_option("--out", settings->folder, "Folder for the results; an experiment that was killed resumes there")
      ->type_name("DIR")
      ->required();
  add_count(app, "-j,--jobs", settings->jobs, {1, kMaxJobs},
            "Number of parallel runs (default: one for each processor)")
      ->default_str("");
  app.add_option("--run-workload", settings->run_workload,
                 "Program run_workload of redag_rclcpp_lab, for 'world: ros2' (default: 'ros2 run redag_rclcpp_lab "
                 "run_workload')")
      ->type_name("PROGRAM");
  return [settings](Console &console) {
    Result<LoadedExperiment> loaded = experiment::load_experiment(
        settings->plan, executors_of,
        [settings](const PlannedRun &planned) { return drive(planned, settings->run_workload); });
    return ok(loaded, console) ? Run(std::move(*loaded), *settings, console).run() : kExitBad;
  };
}

}  // namespace redag::cli
