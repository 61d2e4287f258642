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
#include "redag/trace/trace.hpp"
#include "redag_analysis/text/table.hpp"
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
using experiment::kNoLevel;
using experiment::LoadedExperiment;
using experiment::PlannedRun;
using experiment::Point;
using experiment::ResultRow;
using experiment::Results;
using experiment::UnitStore;
using experiment::World;

struct Settings {
  std::string plan;
  std::string folder;
  std::string run_workload;
  experiment::Shard shard;
  std::uint32_t jobs = 0;  // 0: one per processor
  bool force = false;
};

constexpr std::size_t kMostRowsShown = 100;  // combinations

// True if a point without the last factor is one of the combination: factors that do not affect it have no level.
bool belongs(const Point &point, const Point &combination) {
  for (std::size_t f = 0; f + 1 < point.size(); ++f) {
    if (point[f] != kNoLevel && point[f] != combination[f]) return false;
  }
  return true;
}

// Returns the share over all jobs of all runs. Unlike a median, it shows a miss of a single run.
double share_of(const ResultRow &row) {
  return static_cast<double>(row.counts[1]) / static_cast<double>(std::max<std::uint64_t>(1, row.counts[0]));
}

// Returns the rows of all labels together: the last one of each point.
std::vector<const ResultRow *> totals_of(const Results &results) {
  std::vector<const ResultRow *> totals;
  for (const ResultRow &row : results.rows) {
    if (totals.empty() || totals.back()->point != row.point) totals.push_back(nullptr);
    totals.back() = &row;
  }
  return totals;
}

std::vector<Point> combinations_of(const std::vector<const ResultRow *> &totals) {
  std::vector<Point> combinations;
  for (const ResultRow *row : totals) {
    Point point = row->point;
    point.back() = kNoLevel;
    const auto covers = [&](const Point &other) { return belongs(point, other); };
    if (std::any_of(combinations.begin(), combinations.end(), covers)) continue;
    std::erase_if(combinations, [&](const Point &other) { return belongs(other, point); });
    combinations.push_back(std::move(point));
    if (combinations.size() == kMostRowsShown) break;
  }
  return combinations;
}

std::string by_combination(const Results &results, const std::vector<const ResultRow *> &totals,
                           const std::vector<Point> &combinations, const StreamTraits &traits) {
  std::vector<Column> columns;
  std::vector<std::size_t> shown;
  for (std::size_t f = 0; f + 1 < results.factors.size(); ++f) {
    if (results.factors[f].levels.size() < 2) continue;
    shown.push_back(f);
    columns.push_back({results.factors[f].name, results.factors[f].numeric, 1000});
  }
  for (std::size_t i = 0; i < results.factors.back().levels.size(); ++i) {
    columns.push_back(
        {results.factors.back().levels[i], true, static_cast<unsigned>(900 - std::min<std::size_t>(i, 899))});
  }
  Table table(std::move(columns));
  for (const Point &combination : combinations) {
    std::vector<Cell> cells;
    for (const std::size_t f : shown) {
      cells.push_back({combination[f] == kNoLevel ? "-" : results.factors[f].levels[combination[f]]});
    }
    cells.resize(shown.size() + results.factors.back().levels.size(), {"-", Tint::Faint});
    for (const ResultRow *row : totals) {
      if (!belongs(row->point, combination) || !row->figures[0]) continue;
      cells[shown.size() + row->point.back()] = {format_percent(share_of(*row))};
    }
    table.add(std::move(cells));
  }
  return table.render(traits.width, traits.colour);
}

// Returns a row for each of the first combinations of the factors but the last one, with the share of each level of
// that, and what was checked.
std::string results_table(const Results &results, const StreamTraits &traits) {
  const std::vector<const ResultRow *> totals = totals_of(results);
  const std::vector<Point> combinations = combinations_of(totals);
  std::string text =
      tinted(fmt::format("{}, of all {}", results.counts[1], results.counts[0]), Tint::Strong, traits.colour) + "\n";
  text += by_combination(results, totals, combinations, traits);
  if (combinations.size() == kMostRowsShown) text += "further combinations are only in the files\n";
  text += "\n";
  for (const experiment::Remark &remark : results.remarks) text += remark.text + "\n";
  if (results.done < results.units) {
    text += fmt::format("{} of {} {} are done\n", format_count(results.done), format_count(results.units),
                        results.units_are);
  }
  return text;
}

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

// Prints the errors of a failed result.
template <class T>
bool ok(const Result<T> &result, Console &console) {
  if (!result) console.note(result.error());
  return result.has_value();
}

/// Runs the units of the share that the folder does not have yet.
class Run {
 public:
  Run(LoadedExperiment loaded, const Settings &settings, Console &console)
      : loaded_(std::move(loaded)),
        experiment_(*loaded_.experiment),
        settings_(settings),
        console_(console),
        done_(experiment_.unit_count()) {}

  int run() {
    if (settings_.shard.count > 1 && experiment_.takes_turns()) {
      console_.error("--shard: runs on threads or under ROS 2 depend on one machine",
                     "give each machine a plan and a folder of its own");
      return kExitBad;
    }
    if (!ok(prepare_folder(settings_.folder, settings_.force), console_)) return kExitBad;
    const auto known = [this](std::uint64_t unit, const std::string &result) -> Result<void> {
      if (unit < done_.size() && done_[unit]) return {};
      if (Result<void> added = experiment_.add(unit, result); !added) return added;
      done_[unit] = true;
      return {};
    };
    Result<UnitStore> store = UnitStore::open(settings_.folder, loaded_.subject, settings_.shard, known);
    if (!ok(store, console_)) return kExitBad;
    const InterruptGuard guard;  // covers writing the results too
    const bool good = work(*store);
    // Finished units are kept and shown even if the others failed.
    if (InterruptGuard::interrupted()) {
      console_.note("interrupted: the results so far are kept; run the same command to resume\n");
    }
    const int status = settings_.shard.count > 1 ? kExitOk : show();
    return good ? status : kExitBad;
  }

 private:
  bool work(UnitStore &store) {
    std::vector<std::uint64_t> units;
    for (std::uint64_t unit = 0; unit < done_.size(); ++unit) {
      if (settings_.shard.owns(unit) && !done_[unit]) units.push_back(unit);
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
    console_.note(fmt::format("{} of {} units in {} on {} processor{}\n", finished, units.size(),
                              humanize_duration(progress.elapsed()), jobs, jobs == 1 ? "" : "s"));
    return ok(store.sync(), console_) && good;
  }

  // Writes the files, prints the table, and judges.
  int show() {
    Result<experiment::Results> results = experiment_.results();
    if (!ok(results, console_)) return kExitBad;
    std::vector<std::pair<std::string, std::string>> files = results->files;
    files.emplace_back("results.csv", to_csv(*results));
    files.emplace_back("results.json", to_json(*results, loaded_.plan));
    for (const auto &[name, text] : files) {
      if (!ok(write_text(settings_.folder + "/" + name, text), console_)) return kExitBad;
    }
    console_.say(results_table(*results, console_.out_traits()));
    console_.say(fmt::format("\n{0}/results.csv has all figures with their intervals; 'redag report {0}' draws them\n",
                             settings_.folder));
    for (const experiment::Remark &remark : results->remarks) {
      if (!remark.good) console_.error(remark.text);
    }
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
  app.add_flag("--force", settings->force, "Write into a folder that holds other files");
  add_count(app, "-j,--jobs", settings->jobs, {1, kMaxJobs},
            "Number of parallel runs (default: one for each processor)")
      ->default_str("");
  const auto set_shard = [settings](const std::string &text) {
    const Result<experiment::Shard> shard = experiment::parse_shard(text);
    if (!shard) reject("--shard", shard.error().front().message, shard.error().front().hint);
    settings->shard = *shard;
  };
  app.add_option_function<std::string>("--shard", set_shard,
                                       "Run only share i of n, such as 1/4: one for each machine, all with one folder. "
                                       "The command without it writes the results")
      ->type_name("i/n");
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
