// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/cli/experiment/experiment_run.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstdlib>
#include <optional>
#include <utility>

#include "redag/trace/trace.hpp"
#include "redag/version.hpp"
#include "redag_lab/cli/terminal/commands.hpp"
#include "redag_lab/cli/terminal/files.hpp"
#include "redag_lab/cli/terminal/options.hpp"
#include "redag_lab/cli/terminal/progress.hpp"
#include "redag_lab/cli/terminal/signals.hpp"
#include "redag_lab/experiment/folder.hpp"
#include "redag_lab/experiment/pending_units.hpp"
#include "redag_lab/experiment/ranks.hpp"
#include "redag_lab/experiment/runner.hpp"

namespace redag::cli {
namespace {

using experiment::UnitCursor;
using experiment::UnitStore;

// Prints the errors of a failed result.
template <class T>
bool ok(const Result<T> &result, Console &console) {
  if (!result) console.note(result.error());
  return result.has_value();
}

// Writes the files, prints the table or the JSON document, and prints the study's warnings and errors.
int show(const Study &study, const StudyOutput &output, Console &console) {
  if (!output.folder.empty() && !ok(study.write(output.folder), console)) return kExitBad;
  if (output.json) {
    const std::vector<std::string> runs =
        output.folder.empty() ? std::vector<std::string>{} : experiment::read_runs({output.folder});
    console.print(study.json(runs));
  } else {
    console.say(study.describe(console.out_traits()));
    if (!output.folder.empty()) console.print("\nOpen these files:\n" + study.files(output.folder));
  }
  return study.judge(output.folder, console);
}

/// One run of a study, which starts with the first unfinished unit.
class StudyRun {
 public:
  StudyRun(Study &study, const StudySettings &settings, Console &console)
      : study_(study),
        settings_(settings),
        console_(console),
        progress_(console),
        pending_(study.unit_count(), settings.shard) {}

  int run() {
    if (settings_.mpi && !join()) return kExitBad;
    if (ranks_ == nullptr) return lead();
    const int status = ranks_->rank() == 0 ? lead() : follow();
    ranks_->leave(status);  // the store is closed by now
    return status;
  }

 private:
  bool join() {
    if (study_.takes_turns()) {
      console_.error("--mpi: runs on threads or under ROS 2 depend on one machine",
                     "give each machine a plan and a folder of its own");
      return false;
    }
    Result<std::unique_ptr<experiment::Ranks>> ranks = experiment::Ranks::join();
    if (!ok(ranks, console_)) return false;
    ranks_ = std::move(*ranks);
    if (ranks_->size() == 1) {
      console_.warn("--mpi: this process is alone", "start it with 'mpirun -n N', or leave --mpi out");
    }
    return true;
  }

  int lead() {
    if (!open()) {
      if (ranks_ != nullptr) static_cast<void>(evaluate_all(0, options(), {}));  // ends the other ranks
      return kExitBad;
    }
    const std::uint64_t todo = pending_.count();
    const InterruptGuard guard;  // covers writing the results too
    const bool done = work(todo);
    progress_.clear();
    // Finished units are kept and shown even if the others failed.
    if (InterruptGuard::interrupted()) console_.note("interrupted: " + how_to_go_on() + "\n");
    const int status = show(study_, settings_.output, console_);
    store_.reset();
    return done ? status : kExitBad;
  }

  int follow() {
    const InterruptGuard guard;
    const Result<void> done = ranks_->follow(subject(), options(), evaluate());
    return InterruptGuard::interrupted() || ok(done, console_) ? kExitOk : kExitBad;
  }

  bool open() {
    const StudyOutput &output = settings_.output;
    if (output.folder.empty()) return true;
    if (!ok(prepare_folder(output.folder, output.force), console_)) return false;
    Result<UnitStore> store = experiment::open_folder(output.folder, study_.plan());
    if (!ok(store, console_)) return false;
    store_.emplace(std::move(*store));
    Result<UnitCursor> cursor = store_->units();
    if (!ok(cursor, console_)) return false;
    std::uint64_t found = 0;
    for (;; ++found) {
      const Result<bool> more = cursor->next();
      if (!ok(more, console_)) return false;
      if (!*more) break;
      const experiment::FinishedUnit &finished = cursor->unit();
      if (!ok(study_.add(finished.unit, finished.result), console_)) return false;
      pending_.finish(finished.unit);
    }
    if (found > 0) {
      console_.note(fmt::format("{}: {} of {} {} are done already\n", output.folder, found, study_.unit_count(),
                                study_.units_are()));
    }
    return true;
  }

  [[nodiscard]] experiment::NextUnit next() {
    if (!study_.takes_turns()) return [this] { return pending_.next(); };
    std::vector<std::uint64_t> units;
    while (const std::optional<std::uint64_t> unit = pending_.next()) units.push_back(*unit);
    study_.arrange(units);
    return experiment::units_of(std::move(units));
  }
  [[nodiscard]] experiment::Evaluate evaluate() const {
    return [this](std::uint64_t unit) { return study_.evaluate(unit); };
  }
  // What all ranks must have in common.
  [[nodiscard]] std::string subject() const { return fmt::format("version {}\n{}", kVersion, study_.plan()); }

  [[nodiscard]] experiment::RunnerOptions options() const {
    experiment::RunnerOptions options;
    const std::uint32_t processors = std::max<std::uint32_t>(1, trace::this_machine().cpus);
    options.jobs = settings_.jobs > 0 ? settings_.jobs : ranks_ != nullptr ? 1 : processors;
    if (study_.takes_turns()) options.jobs = 1;
    options.stop = &InterruptGuard::flag();
    return options;
  }

  bool work(std::uint64_t todo) {
    if (todo == 0 && ranks_ == nullptr) return true;
    const std::string &folder = settings_.output.folder;
    const experiment::RunnerOptions options = this->options();
    const std::uint32_t ranks = ranks_ == nullptr ? 1 : ranks_->size();
    const experiment::RunBegin begin{.shard = settings_.shard, .jobs = options.jobs, .ranks = ranks, .units = todo};
    if (store_ && !ok(log_run(folder, begin), console_)) return false;
    const Stopwatch watch;
    std::uint64_t finished = 0;
    const auto accept = [&](std::uint64_t unit, const std::string &result) -> Result<void> {
      if (store_) {
        if (auto kept = store_->append(unit, result); !kept) return kept;
      }
      ++finished;
      if (progress_.due()) {
        progress_.draw(static_cast<double>(finished) / static_cast<double>(todo),
                       pace(finished, todo, watch.elapsed()));
      }
      return study_.add(unit, result);
    };
    const Result<void> ran = evaluate_all(todo, options, accept);
    progress_.clear();
    const Duration elapsed = watch.elapsed();
    // A unit that Ctrl-C interrupted has no result, and this is no error.
    bool good = InterruptGuard::interrupted() || ok(ran, console_);
    if (store_) {
      good = ok(store_->sync(), console_) && good;
      good =
          ok(log_run(folder, experiment::RunEnd{finished, elapsed, InterruptGuard::interrupted()}), console_) && good;
    }
    const std::uint32_t processors = options.jobs * ranks;
    console_.note(fmt::format("{} {} in {}, {:.{}f} a second on {} processor{}\n", finished, study_.units_are(),
                              humanize_duration(elapsed),
                              1e9 * static_cast<double>(finished) / static_cast<double>(std::max<Duration>(elapsed, 1)),
                              study_.takes_turns() ? 2 : 0, processors, processors == 1 ? "" : "s"));
    return good;
  }

  Result<void> evaluate_all(std::uint64_t todo, const experiment::RunnerOptions &options,
                            const experiment::Accept &accept) {
    if (ranks_ == nullptr) {
      return experiment::run_units(next(), options, evaluate(), accept).map([](std::uint64_t /*accepted*/) {});
    }
    const Result<experiment::LeadReport> report = ranks_->lead(subject(), next(), todo, options, evaluate(), accept);
    if (!report) return tl::unexpected<Diagnostics>(report.error());
    if (report->silent > 0 && !InterruptGuard::interrupted()) {
      progress_.clear();
      console_.warn(fmt::format("{} of {} ranks no longer answer: what they had not finished was done again ({} {})",
                                report->silent, ranks_->size(), format_count(report->repeated), study_.units_are()));
    }
    return {};
  }

  [[nodiscard]] std::string how_to_go_on() const {
    if (!store_) {
      return fmt::format("the results cover only the {} so far; with --out DIR, a run can be resumed later",
                         study_.units_are());
    }
    return "the results so far are kept; run the same command to resume";
  }

  Study &study_;
  const StudySettings &settings_;
  Console &console_;
  Progress progress_;
  experiment::PendingUnits pending_;
  std::optional<UnitStore> store_;
  std::unique_ptr<experiment::Ranks> ranks_;
};

}  // namespace

CLI::Option *add_study_output(CLI::App &app, StudyOutput &output, const std::string &names, const std::string &help) {
  CLI::Option *folder = app.add_option(names, output.folder, help)->type_name("DIR");
  app.add_flag("--force", output.force, "Write into a folder that holds other files")->needs(folder);
  app.add_flag("--json", output.json, "Write one JSON document, and nothing else, to standard output");
  return folder;
}

void add_study_settings(CLI::App &app, StudySettings &settings) {
  add_count(app, "-j,--jobs", settings.jobs, {1, kMaxJobs}, "Number of parallel runs (default: one for each processor)")
      ->default_str("");
  const auto set_shard = [&settings](const std::string &text) {
    const Result<experiment::Shard> shard =
        text == "auto" ? experiment::shard_of_environment(::getenv) : experiment::parse_shard(text);
    if (!shard) reject("--shard", shard.error().front().message, shard.error().front().hint);
    settings.shard = *shard;
  };
  app.add_option_function<std::string>(
         "--shard", set_shard,
         "Run only share i of n, such as 1/4, one for each machine; auto: the share of this task of "
         "Slurm, or of this rank of mpirun")
      ->type_name("i/n");
  app.add_flag("--mpi", settings.mpi,
               "Share the units among the processes of mpirun; the first one writes the results. Implies -j1 for each");
  add_study_output(app, settings.output, "--out",
                   "Folder for the results; an experiment that was killed resumes there. {shard} in its name is "
                   "the number of the share");
}

int run_study(Study &study, StudySettings settings, Console &console) {
  constexpr std::string_view kPlace = "{shard}";
  std::string &folder = settings.output.folder;
  if (const std::size_t at = folder.find(kPlace); at != std::string::npos) {
    folder.replace(at, kPlace.size(), fmt::format("{}", settings.shard.index));
  }
  return StudyRun(study, settings, console).run();
}

Result<MergedUnits> read_merged(const std::vector<std::string> &folders) {
  Result<std::string> text = experiment::read_plan(folders.front());
  if (!text) return tl::unexpected<Diagnostics>(std::move(text.error()));
  const auto visit = [folders, plan = *text](const experiment::Accept &accept) {
    return experiment::visit_units(folders, plan, accept);
  };
  return MergedUnits{std::move(*text), folders.front() + "/plan.yaml", visit, experiment::read_runs(folders)};
}

int merge_studies(const MergedUnits &merged, const StudyOutput &output, const StudyMaker &make, Console &console) {
  const std::string &folder = output.folder;
  const std::unique_ptr<Study> study = make(merged.plan, merged.plan_file, console);
  if (study == nullptr) return kExitBad;
  // The first visit finds every mistake before the second one writes.
  const auto count = [&study](std::uint64_t unit, const std::string &result) { return study->add(unit, result); };
  if (!ok(merged.visit(count), console)) return kExitBad;
  if (!ok(prepare_folder(folder, output.force), console)) return kExitBad;
  Result<UnitStore> store = experiment::open_folder(folder, merged.plan);
  if (!ok(store, console)) return kExitBad;
  const Result<bool> any = store->units().and_then([](UnitCursor &&cursor) { return cursor.next(); });
  if (!ok(any, console)) return kExitBad;
  if (*any) {
    console.error(fmt::format("{} already holds results", folder),
                  "merge into a new folder, or name this folder as a source, too");
    return kExitBad;
  }
  const auto keep = [&store](std::uint64_t unit, const std::string &result) { return store->append(unit, result); };
  if (!ok(merged.visit(keep), console) || !ok(store->sync(), console)) return kExitBad;
  if (!ok(experiment::add_runs(folder, merged.runs), console)) return kExitBad;
  if (study->done() < study->unit_count()) {
    console.warn(fmt::format("{} of {} {} are missing from the folders", study->unit_count() - study->done(),
                             study->unit_count(), study->units_are()),
                 fmt::format("'redag experiment {1} {0}/plan.yaml --out {0}' runs them", folder, study->command()));
  }
  return show(*study, output, console);
}

}  // namespace redag::cli
