// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/cli/experiment/experiment_run.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <optional>
#include <utility>

#include "redag/trace/trace.hpp"
#include "redag_lab/cli/terminal/commands.hpp"
#include "redag_lab/cli/terminal/files.hpp"
#include "redag_lab/cli/terminal/options.hpp"
#include "redag_lab/cli/terminal/progress.hpp"
#include "redag_lab/cli/terminal/signals.hpp"
#include "redag_lab/experiment/folder.hpp"
#include "redag_lab/experiment/runner.hpp"

namespace redag::cli {
namespace {

using experiment::FinishedUnit;
using experiment::Journal;

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
    console.print(study.describe(console.out_traits()));
    if (!output.folder.empty()) console.print("\nOpen these files:\n" + study.files(output.folder));
  }
  return study.judge(output.folder, console);
}

/// One run of a study, which starts with the first unfinished unit.
class StudyRun {
 public:
  StudyRun(Study &study, const StudySettings &settings, Console &console)
      : study_(study), settings_(settings), console_(console), progress_(console) {}

  int run() {
    if (!open()) return kExitBad;
    const std::vector<std::uint64_t> todo = units_to_do();
    const InterruptGuard guard;  // covers writing the results too
    const bool done = work(todo);
    progress_.clear();
    // Finished units are kept and shown even if the others failed.
    if (InterruptGuard::interrupted()) console_.note("interrupted: " + how_to_go_on() + "\n");
    const int status = show(study_, settings_.output, console_);
    return done ? status : kExitBad;
  }

 private:
  bool open() {
    const StudyOutput &output = settings_.output;
    if (output.folder.empty()) return true;
    if (!ok(prepare_folder(output.folder, output.force), console_)) return false;
    Result<Journal> journal = experiment::open_folder(output.folder, study_.plan());
    if (!ok(journal, console_)) return false;
    journal_.emplace(std::move(*journal));
    for (const FinishedUnit &finished : journal_->found()) {
      if (!ok(study_.add(finished.unit, finished.result), console_)) return false;
    }
    if (!journal_->found().empty()) {
      console_.note(fmt::format("{}: {} of {} {} are done already\n", output.folder, journal_->found().size(),
                                study_.unit_count(), study_.units_are()));
    }
    return true;
  }

  [[nodiscard]] std::vector<std::uint64_t> units_to_do() const {
    std::vector<std::uint64_t> todo;
    const std::vector<FinishedUnit> none;
    const std::vector<FinishedUnit> &found = journal_ ? journal_->found() : none;
    auto done = found.begin();  // sorted by unit
    for (std::uint64_t unit = 0; unit < study_.unit_count(); ++unit) {
      while (done != found.end() && done->unit < unit) ++done;
      const bool is_done = done != found.end() && done->unit == unit;
      if (!is_done && settings_.shard.owns(unit)) todo.push_back(unit);
    }
    study_.arrange(todo);
    return todo;
  }

  bool work(const std::vector<std::uint64_t> &todo) {
    if (todo.empty()) return true;
    const std::string &folder = settings_.output.folder;
    experiment::RunnerOptions options;
    options.jobs = settings_.jobs > 0 ? settings_.jobs : std::max<std::uint32_t>(1, trace::this_machine().cpus);
    if (study_.takes_turns()) options.jobs = 1;
    options.stop = &InterruptGuard::flag();
    if (journal_ && !ok(log_run(folder, experiment::RunBegin{settings_.shard, options.jobs, todo.size()}), console_)) {
      return false;
    }
    const Stopwatch watch;
    std::uint64_t finished = 0;
    const Result<std::uint64_t> ran = experiment::run_units(
        todo, options, [this](std::uint64_t unit) { return study_.evaluate(unit); },
        [&](std::uint64_t unit, const std::string &result) -> Result<void> {
          if (journal_) {
            if (auto kept = journal_->append(unit, result); !kept) return kept;
          }
          ++finished;
          if (progress_.due()) {
            progress_.draw(static_cast<double>(finished) / static_cast<double>(todo.size()),
                           pace(finished, todo.size(), watch.elapsed()));
          }
          return study_.add(unit, result);
        });
    progress_.clear();
    const Duration elapsed = watch.elapsed();
    // A unit that Ctrl-C interrupted has no result, and this is no error.
    bool good = InterruptGuard::interrupted() || ok(ran, console_);
    if (journal_) {
      good = ok(journal_->sync(), console_) && good;
      good =
          ok(log_run(folder, experiment::RunEnd{finished, elapsed, InterruptGuard::interrupted()}), console_) && good;
    }
    console_.note(fmt::format("{} {} in {}, {:.{}f} a second on {} processor{}\n", finished, study_.units_are(),
                              humanize_duration(elapsed),
                              1e9 * static_cast<double>(finished) / static_cast<double>(std::max<Duration>(elapsed, 1)),
                              study_.takes_turns() ? 2 : 0, options.jobs, options.jobs == 1 ? "" : "s"));
    return good;
  }

  [[nodiscard]] std::string how_to_go_on() const {
    if (!journal_) {
      return fmt::format("the results cover only the {} so far; with --out DIR, a run can be resumed later",
                         study_.units_are());
    }
    return "the results so far are kept; run the same command to resume";
  }

  Study &study_;
  const StudySettings &settings_;
  Console &console_;
  Progress progress_;
  std::optional<Journal> journal_;
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
    const Result<experiment::Shard> shard = experiment::parse_shard(text);
    if (!shard) reject("--shard", shard.error().front().message, shard.error().front().hint);
    settings.shard = *shard;
  };
  app.add_option_function<std::string>("--shard", set_shard, "Run only share i of n, such as 1/4, one for each machine")
      ->type_name("i/n");
  add_study_output(app, settings.output, "--out",
                   "Folder for the results; an experiment that was killed resumes there");
}

int run_study(Study &study, const StudySettings &settings, Console &console) {
  return StudyRun(study, settings, console).run();
}

Result<MergedUnits> read_merged(const std::vector<std::string> &folders) {
  Result<std::string> text = experiment::read_plan(folders.front());
  if (!text) return tl::unexpected<Diagnostics>(std::move(text.error()));
  Result<std::vector<FinishedUnit>> units = experiment::read_folders(folders, *text);
  if (!units) return tl::unexpected<Diagnostics>(std::move(units.error()));
  return MergedUnits{std::move(*text), folders.front() + "/plan.yaml", std::move(*units),
                     experiment::read_runs(folders)};
}

int merge_studies(const MergedUnits &merged, const StudyOutput &output, const StudyMaker &make, Console &console) {
  const std::string &folder = output.folder;
  const std::unique_ptr<Study> study = make(merged.plan, merged.plan_file, console);
  if (study == nullptr) return kExitBad;
  for (const FinishedUnit &unit : merged.units) {
    if (!ok(study->add(unit.unit, unit.result), console)) return kExitBad;
  }
  if (!ok(prepare_folder(folder, output.force), console)) return kExitBad;
  Result<Journal> journal = experiment::open_folder(folder, merged.plan);
  if (!ok(journal, console)) return kExitBad;
  if (!journal->found().empty()) {
    console.error(fmt::format("{} already holds results", folder),
                  "merge into a new folder, or name this folder as a source, too");
    return kExitBad;
  }
  for (const FinishedUnit &unit : merged.units) {
    if (!ok(journal->append(unit.unit, unit.result), console)) return kExitBad;
  }
  if (!ok(journal->sync(), console)) return kExitBad;
  if (!ok(experiment::add_runs(folder, merged.runs), console)) return kExitBad;
  if (study->done() < study->unit_count()) {
    console.warn(fmt::format("{} of {} {} are missing from the folders", study->unit_count() - study->done(),
                             study->unit_count(), study->units_are()),
                 fmt::format("'redag experiment {1} {0}/plan.yaml --out {0}' runs them", folder, study->command()));
  }
  return show(*study, output, console);
}

}  // namespace redag::cli
