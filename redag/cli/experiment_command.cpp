#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <memory>
#include <optional>

#include "redag/cli/commands.hpp"
#include "redag/cli/experiment_plan_options.hpp"
#include "redag/cli/experiment_report.hpp"
#include "redag/cli/files.hpp"
#include "redag/cli/options.hpp"
#include "redag/cli/progress.hpp"
#include "redag/cli/signals.hpp"
#include "redag/experiment/acceptance_results.hpp"
#include "redag/experiment/folder.hpp"
#include "redag/experiment/runner.hpp"
#include "redag/trace/trace.hpp"

namespace redag::cli {
namespace {

using experiment::Acceptance;
using experiment::AcceptanceCounter;
using experiment::AcceptancePlan;
using experiment::FinishedUnit;
using experiment::Journal;

struct Output {
  std::string folder;
  bool force = false;
  bool json = false;
};

struct RunSettings {
  std::uint32_t jobs = 0;  // 0: one a processor
  experiment::Shard shard;
  Output output;
};

struct MergeSettings {
  std::vector<std::string> folders;
  Output output;
};

// Notes what went wrong.
template <class T>
bool ok(const Result<T> &result, Console &console) {
  if (!result) console.note(result.error());
  return result.has_value();
}

// The table or the JSON document, the files, and what must not be overlooked.
int show(const Acceptance &acceptance, const experiment::AcceptanceResults &results, const Output &output,
         Console &console) {
  if (!output.folder.empty() && !ok(write_results(output.folder, acceptance, results), console)) return kExitBad;
  if (output.json) {
    const std::vector<std::string> runs =
        output.folder.empty() ? std::vector<std::string>{} : experiment::read_runs({output.folder});
    console.print(to_json(acceptance, results, runs));
  } else {
    console.print(describe(acceptance, results, console.out_traits()));
    if (!output.folder.empty()) {
      console.print(
          fmt::format("\nOpen these files:\n"
                      "  {0}/acceptance.svg   the plot\n"
                      "  {0}/acceptance.csv, acceptance.json   the figures, with their confidence intervals\n",
                      output.folder));
    }
  }
  for (const experiment::Violation &violation : results.violations) {
    const std::string place = output.folder.empty()
                                  ? std::string("run it again with --out DIR for a file to replay")
                                  : fmt::format("replay: {}/violation-{}.yaml", output.folder, violation.unit);
    console.error(fmt::format("unit {} ({}) misses a deadline in the simulation, but is accepted by {}", violation.unit,
                              describe(acceptance.point_of(violation.unit)), fmt::join(violation.methods, ", ")),
                  place);
  }
  return results.violations.empty() ? kExitOk : kExitNo;
}

/// One run of the experiment, from the first unit that is not finished.
class AcceptanceRun {
 public:
  AcceptanceRun(AcceptancePlan plan, const RunSettings &settings, Console &console)
      : acceptance_(std::move(plan)),
        counter_(acceptance_),
        settings_(settings),
        console_(console),
        progress_(console) {}

  int run() {
    if (!open()) return kExitBad;
    const std::vector<std::uint64_t> todo = units_to_do();
    const InterruptGuard guard;  // until the results are written
    const bool done = work(todo);
    progress_.clear();
    // What is done is kept and shown, also where the rest could not be.
    if (InterruptGuard::interrupted()) console_.note("interrupted: " + how_to_go_on() + "\n");
    const int status = show(acceptance_, counter_.results(), settings_.output, console_);
    return done ? status : kExitBad;
  }

 private:
  bool open() {
    const Output &output = settings_.output;
    if (output.folder.empty()) return true;
    if (!ok(prepare_folder(output.folder, output.force), console_)) return false;
    Result<Journal> journal = experiment::open_folder(output.folder, to_yaml(acceptance_.plan()));
    if (!ok(journal, console_)) return false;
    journal_.emplace(std::move(*journal));
    for (const FinishedUnit &finished : journal_->found()) {
      if (!ok(counter_.add(finished.unit, finished.result), console_)) return false;
    }
    if (!journal_->found().empty()) {
      console_.note(fmt::format("{}: {} of {} workloads are done already\n", output.folder, journal_->found().size(),
                                counter_.results().units));
    }
    return true;
  }

  [[nodiscard]] std::vector<std::uint64_t> units_to_do() const {
    std::vector<std::uint64_t> todo;
    const std::vector<FinishedUnit> none;
    const std::vector<FinishedUnit> &found = journal_ ? journal_->found() : none;
    auto done = found.begin();  // sorted, as the units are
    for (std::uint64_t unit = 0; unit < counter_.results().units; ++unit) {
      while (done != found.end() && done->unit < unit) ++done;
      const bool is_done = done != found.end() && done->unit == unit;
      if (!is_done && settings_.shard.owns(unit)) todo.push_back(unit);
    }
    return todo;
  }

  bool work(const std::vector<std::uint64_t> &todo) {
    if (todo.empty()) return true;
    const std::string &folder = settings_.output.folder;
    experiment::RunnerOptions options;
    options.jobs = settings_.jobs > 0 ? settings_.jobs : std::max<std::uint32_t>(1, trace::this_machine().cpus);
    options.stop = &InterruptGuard::flag();
    if (journal_ && !ok(log_run(folder, experiment::RunBegin{settings_.shard, options.jobs, todo.size()}), console_)) {
      return false;
    }
    const Stopwatch watch;
    std::uint64_t finished = 0;
    const Result<std::uint64_t> ran = experiment::run_units(
        todo, options, [this](std::uint64_t unit) { return acceptance_.evaluate(unit); },
        [&](std::uint64_t unit, const std::string &result) -> Result<void> {
          if (journal_) {
            if (auto kept = journal_->append(unit, result); !kept) return kept;
          }
          ++finished;
          if (progress_.due()) {
            progress_.draw(static_cast<double>(finished) / static_cast<double>(todo.size()),
                           pace(finished, todo.size(), watch.elapsed()));
          }
          return counter_.add(unit, result);
        });
    progress_.clear();
    const Duration elapsed = watch.elapsed();
    bool good = ok(ran, console_);
    if (journal_) {
      good = ok(journal_->sync(), console_) && good;
      good =
          ok(log_run(folder, experiment::RunEnd{finished, elapsed, InterruptGuard::interrupted()}), console_) && good;
    }
    console_.note(fmt::format("{} workloads in {}, {:.0f}/s on {} core{}\n", finished, humanize_duration(elapsed),
                              1e9 * static_cast<double>(finished) / static_cast<double>(std::max<Duration>(elapsed, 1)),
                              options.jobs, options.jobs == 1 ? "" : "s"));
    return good;
  }

  [[nodiscard]] std::string how_to_go_on() const {
    if (!journal_) return "the results are those of the workloads so far; with --out DIR a run can go on later";
    return "the results so far are kept; the same command goes on";
  }

  Acceptance acceptance_;
  AcceptanceCounter counter_;
  const RunSettings &settings_;
  Console &console_;
  Progress progress_;
  std::optional<Journal> journal_;
};

int merge(const MergeSettings &settings, Console &console) {
  const std::string &folder = settings.output.folder;
  const Result<std::string> text = experiment::read_plan(settings.folders.front());
  if (!ok(text, console)) return kExitBad;
  Result<AcceptancePlan> plan = experiment::parse_acceptance_plan(*text, settings.folders.front() + "/plan.yaml");
  if (!ok(plan, console)) return kExitBad;
  const Result<std::vector<FinishedUnit>> units = experiment::read_folders(settings.folders, *text);
  if (!ok(units, console)) return kExitBad;

  const Acceptance acceptance(std::move(*plan));
  AcceptanceCounter counter(acceptance);
  for (const FinishedUnit &unit : *units) {
    if (!ok(counter.add(unit.unit, unit.result), console)) return kExitBad;
  }
  if (!ok(prepare_folder(folder, settings.output.force), console)) return kExitBad;
  Result<Journal> journal = experiment::open_folder(folder, *text);
  if (!ok(journal, console)) return kExitBad;
  if (!journal->found().empty()) {
    console.error(fmt::format("{} holds results already", folder),
                  "merge into a new folder, or name it as a source too");
    return kExitBad;
  }
  for (const FinishedUnit &unit : *units) {
    if (!ok(journal->append(unit.unit, unit.result), console)) return kExitBad;
  }
  if (!ok(journal->sync(), console)) return kExitBad;
  if (!ok(experiment::add_runs(folder, experiment::read_runs(settings.folders)), console)) return kExitBad;
  const experiment::AcceptanceResults &results = counter.results();
  if (!results.complete()) {
    console.warn(
        fmt::format("{} of {} workloads are in none of the folders", results.units - results.done, results.units),
        fmt::format("'redag experiment acceptance {0}/plan.yaml --out {0}' makes them", folder));
  }
  return show(acceptance, results, settings.output, console);
}

void add_output(CLI::App &app, Output &output, const std::string &names, const std::string &help) {
  app.add_option(names, output.folder, help)->type_name("DIR");
  app.add_flag("--force", output.force, "Write into a folder that holds other files");
  app.add_flag("--json", output.json, "Write one JSON document to standard output, and nothing else");
}

Action add_acceptance(CLI::App &app) {
  const auto plan = std::make_shared<PlanOptions>(app);
  const auto settings = std::make_shared<RunSettings>();
  add_count(app, "-j,--jobs", settings->jobs, "Workloads judged at the same time; default: one a processor")
      ->default_str("");
  const auto set_shard = [settings](const std::string &text) {
    const Result<experiment::Shard> shard = experiment::parse_shard(text);
    if (!shard) reject("--shard", shard.error().front().message, shard.error().front().hint);
    settings->shard = *shard;
  };
  app.add_option_function<std::string>("--shard", set_shard, "Do only the i-th of n shares: one for each machine")
      ->type_name("i/n");
  add_output(app, settings->output, "--out", "Folder for the results; a run that was killed goes on there");
  app.footer(
      "Examples:\n"
      "  redag experiment acceptance --dags 10 --workers 4 --methods guan,any,simulation --out results/guan\n"
      "  redag experiment acceptance experiments/acceptance_tasks.yaml --sets 1000 --out results/tasks\n"
      "  redag experiment acceptance experiments/acceptance_dags.yaml --shard 1/3 --out results/dags-1\n"
      "  redag experiment acceptance --dags 3 --min-tasks 3 --max-tasks 8 --utilization 0.1:1:0.1 --json\n");
  return [plan, settings](Console &console) {
    std::optional<AcceptancePlan> read = plan->plan(console);
    if (!read) return kExitBad;
    return AcceptanceRun(std::move(*read), *settings, console).run();
  };
}

Action add_merge(CLI::App &app) {
  const auto settings = std::make_shared<MergeSettings>();
  app.add_option("DIR", settings->folders, "Folders of the shards (--out); the same plan in all")
      ->type_name("DIR")
      ->required();
  add_output(app, settings->output, "-o,--out", "Folder for the whole");
  app.get_option("--out")->required();
  app.footer("Examples:\n  redag experiment merge results/dags-1 results/dags-2 results/dags-3 --out results/dags\n");
  return [settings](Console &console) { return merge(*settings, console); };
}

}  // namespace

Action add_experiment(CLI::App &app) {
  app.require_subcommand(1);
  CLI::App *acceptance =
      app.add_subcommand("acceptance", "Which share of random workloads do the bounds accept, over utilization?");
  CLI::App *together = app.add_subcommand("merge", "Put the shards of several machines together");
  return [acceptance, together, run = add_acceptance(*acceptance), join = add_merge(*together)](Console &console) {
    return (acceptance->parsed() ? run : join)(console);
  };
}

}  // namespace redag::cli
