// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <memory>
#include <set>
#include <string>
#include <system_error>

#include "redag/base/text.hpp"
#include "redag/derived/waits.hpp"
#include "redag_lab/cli/run/compare_recorded.hpp"
#include "redag_lab/cli/run/comparison_report.hpp"
#include "redag_lab/cli/run/run_arguments.hpp"
#include "redag_lab/cli/run/run_report.hpp"
#include "redag_lab/cli/terminal/commands.hpp"
#include "redag_lab/cli/terminal/files.hpp"
#include "redag_lab/cli/terminal/options.hpp"
#include "redag_lab/cli/terminal/signals.hpp"

namespace redag::cli {
namespace {

constexpr Duration kThreadsDuration = 5 * kSecond;
constexpr std::uint32_t kThreadsRepetitions = 3;
constexpr std::uint32_t kMostRepetitions = 10'000;
constexpr double kMostTolerance = 0.99;  // at 1, all values would be equal

struct CompareOptions {
  RunArguments run;
  std::string executors = "redag,mte,ste";
  std::uint32_t repeat = 0;  // 0: not given
  bool simulate = false;
  CompareRecordedOptions recorded;  // with `b`, two recorded results are compared, and nothing runs
};

// Returns false after naming the executors that keep a worker while a callback waits, if some callback does.
bool know_waits(const CompareOptions &options, const std::vector<lab::Variant> &variants, const Workload &workload,
                Console &console) {
  std::vector<std::string> lacking;
  for (const lab::Variant &variant : variants) {
    if (!variant.is_redag()) lacking.push_back(variant.name);
  }
  if (lacking.empty() || !has_waits(workload)) return true;
  if (options.run.file != "-") (void)load_configured(options.run, console);  // names each such task with its line
  console.error(
      fmt::format("--executors: segments cannot be simulated for {}", fmt::join(lacking, ", ")),
      "they can for redag, redag-none, redag-cooperative and redag-os; or state 'wcet:' in place of 'segments:'");
  return false;
}

class Comparing {
 public:
  Comparing(const CompareOptions &options, const Workload &workload, const lab::SessionOptions &session,
            const std::vector<lab::Variant> &variants, std::uint32_t repetitions, Console &console)
      : options_(options),
        workload_(workload),
        session_(session),
        repetitions_(repetitions),
        console_(console),
        progress_(console) {
    for (const lab::Variant &variant : variants)
      results_.push_back(lab::ExecutorResults{variant, {}, {}, {}, false, 0, {}});
  }

  int run() {
    if (const auto busy = options_.simulate ? std::nullopt : lab::busy_machine_warning()) {
      console_.warn(*busy);
      warnings_.push_back(*busy);
    }
    const InterruptGuard guard;  // covers writing the results too
    if (!run_all()) return kExitBad;
    progress_.clear();
    const std::size_t done = rounds();
    if (done == 0) {
      console_.error("interrupted before every executor had run once: there is nothing to compare");
      return kExitBad;
    }
    // Keeps whole rounds only: every executor has the same number of repetitions.
    for (lab::ExecutorResults &results : results_) results.repetitions.resize(done);
    if (done < repetitions_)
      console_.warn(fmt::format("interrupted: {} of {} repetitions are complete", done, repetitions_));
    return report();
  }

 private:
  // Runs all repetitions. Returns false after printing an error.
  bool run_all() {
    session_.stop = &InterruptGuard::flag();
    for (std::uint32_t repetition = 0; repetition < repetitions_; ++repetition) {
      // The order rotates: no executor always runs on the warmest or the quietest machine.
      for (std::size_t i = 0; i < results_.size(); ++i) {
        if (!run_one(results_[(i + repetition) % results_.size()], repetition)) return false;
        if (InterruptGuard::interrupted()) return true;
      }
    }
    return true;
  }

  bool run_one(lab::ExecutorResults &results, std::uint32_t repetition) {
    lab::SessionOptions options = session_;
    // Virtual time repeats exactly. Only another seed makes another repetition.
    if (options_.simulate) options.seed += repetition;
    progress_.set_label(fmt::format("{} {}/{}", results.variant.name, repetition + 1, repetitions_));
    Result<lab::Session> session =
        lab::run_session(workload_, results.variant, options, progress_hook(progress_, workload_, options.duration));
    progress_.clear();
    if (!session) {
      for (const Diagnostic &problem : session.error()) {
        console_.error(results.variant.name + ": " + problem.message, problem.hint);
      }
      return false;
    }
    if (session->stopped) return true;  // shorter than the others and not comparable
    results.add(*session);
    if (!session->check.ok()) {
      console_.note(fmt::format("{}, repetition {}: {}", results.variant.name, repetition + 1,
                                describe_check(session->check, console_.err_traits())));
    }
    return write(*session, results.variant, repetition);
  }

  bool write(lab::Session &session, const lab::Variant &variant, std::uint32_t repetition) {
    if (options_.run.folder.empty()) return true;
    const std::string folder = fmt::format("{}/{}/repetition-{}", options_.run.folder, variant.name, repetition + 1);
    if (!ok(prepare_folder(folder), console_)) return false;
    const WrittenFiles written = write_session(session, {.folder = folder});
    console_.note(written.problems);
    all_written_ = all_written_ && written.problems.empty();
    return true;
  }

  [[nodiscard]] std::size_t rounds() const {
    std::size_t least = results_.front().repetitions.size();
    for (const lab::ExecutorResults &results : results_) least = std::min(least, results.repetitions.size());
    return least;
  }

  [[nodiscard]] lab::Comparison comparison() {
    lab::Comparison comparison;
    comparison.workload = workload_.name;
    for (const Dag &dag : workload_.dags) comparison.dags.push_back(dag.name);
    comparison.dags.emplace_back("total");
    comparison.driver = session_.driver;
    comparison.duration = session_.duration;
    comparison.seed = session_.seed;
    comparison.workers = workload_.platform.workers;
    comparison.executors = results_;
    comparison.warnings = warnings_;
    return comparison;
  }

  int report() {
    const lab::Comparison compared = comparison();
    for (const lab::ExecutorResults &results : results_) {
      for (const std::string &warning : results.warnings) console_.warn(results.variant.name + ": " + warning);
    }
    const std::string document = to_text(to_json(compared));
    if (options_.run.json) {
      console_.print(document);
    } else {
      console_.say(describe(compared, console_.out_traits()));
    }
    const std::string &folder = options_.run.folder;
    if (!folder.empty()) {
      all_written_ = ok(write_text(folder + "/comparison.json", document), console_) && all_written_;
      const std::string words = fmt::format(
          "\nwrote {0}/: comparison.json, and the files of each run; 'redag report {0}' makes a page\n", folder);
      options_.run.json ? console_.note(words) : console_.say(words);
    }
    if (!all_written_) return kExitBad;
    const bool violated = std::any_of(results_.begin(), results_.end(),
                                      [](const lab::ExecutorResults &results) { return results.check_violations > 0; });
    const bool missed = compared.executors.front().has_misses();
    return violated || (options_.run.check && missed) ? kExitNo : kExitOk;
  }

  const CompareOptions &options_;
  const Workload &workload_;
  lab::SessionOptions session_;
  std::uint32_t repetitions_;
  Console &console_;
  Progress progress_;
  std::vector<lab::ExecutorResults> results_;
  std::vector<std::string> warnings_;
  bool all_written_ = true;
};

// Returns the first option given that only runs take; empty: none.
std::string option_of_runs(const CLI::App &app) {
  const std::set<std::string> fits = {"FILE", "B", "--tolerance", "--different", "--all-tasks", "--check"};
  for (const CLI::Option *option : app.get_options()) {
    if (option->count() > 0 && !fits.contains(option->get_name())) return option->get_name();
  }
  return {};
}

// Compares two results of earlier runs.
int compare_results(const CompareOptions &options, const CLI::App &app, Console &console) {
  if (const std::string name = option_of_runs(app); !name.empty()) {
    console.error(name + " is for runs: A and B are compared as they were recorded", "leave it out, or B");
    return kExitBad;
  }
  CompareRecordedOptions recorded = options.recorded;
  recorded.a = options.run.file;
  recorded.check = options.run.check;
  return compare_recorded(recorded, console);
}

int compare(const CompareOptions &options, const CLI::App &app, Console &console) {
  if (!options.recorded.b.empty()) return compare_results(options, app, console);
  if (std::error_code error; std::filesystem::is_directory(options.run.file, error)) {
    console.error(in_quotes(options.run.file) + " is a folder: name the result to compare it with, or a workload file");
    return kExitBad;
  }
  const Result<std::vector<lab::Variant>> variants = lab::parse_variants(options.executors);
  if (!ok(variants, console)) return kExitBad;
  if (variants->size() < 2) {
    console.error(fmt::format("--executors: there is no other executor to compare '{}' with", variants->front().name),
                  "name two or more, such as redag,mte; 'redag run' runs a single one");
    return kExitBad;
  }
  for (const lab::Variant &variant : *variants) {
    if (!options.simulate || !variant.realtime_threads) continue;
    console.error(fmt::format("the simulator has no threads to make real-time: '{}' is the same as '{}' there",
                              variant.name, variant.executor));
    return kExitBad;
  }
  const std::uint32_t repetitions = options.repeat > 0 ? options.repeat : (options.simulate ? 1 : kThreadsRepetitions);
  const std::optional<Workload> workload = load_configured(options.run, console, {.waits = true});
  if (!workload || !know_waits(options, *variants, *workload, console)) return kExitBad;
  if (!takes_arguments(*variants, options.run, console)) return kExitBad;
  if (options.simulate && options.run.seed + (repetitions - 1) < options.run.seed) {
    console.error("--seed and --repeat: the last seed is not below 2^64", "choose a smaller first seed");
    return kExitBad;
  }
  for (const lab::Variant &variant : *variants) {
    if (!ok(lab::configure(*workload, variant), console)) return kExitBad;
  }
  const trace::Driver driver = options.simulate ? trace::Driver::Simulator : trace::Driver::Threads;
  const Duration usual = options.simulate ? lab::sensible_duration(*workload) : kThreadsDuration;
  const std::optional<lab::SessionOptions> session = session_options(options.run, driver, usual, console);
  if (!session) return kExitBad;
  return Comparing(options, *workload, *session, *variants, repetitions, console).run();
}

}  // namespace

Action add_compare(CLI::App &app) {
  auto options = std::make_shared<CompareOptions>();
  add_workload_arguments(app, options->run,
                         "Workload to run (YAML; - reads standard input), or a folder of results: A");
  CLI::Option *other =
      app.add_option("B", options->recorded.b,
                     "Folder of results to compare with those of A, as written by run, simulate, compare, or by "
                     "run_workload of ROS 2; nothing is run then")
          ->type_name("RESULT");
  app.add_option("--executors", options->executors,
                 "Executors to compare: redag, redag-none, redag-cooperative, redag-os, mte, ste, static, events, cbg; "
                 "with -fifo (mte-fifo, ...) on real-time threads")
      ->type_name("LIST")
      ->capture_default_str();
  add_count(app, "--repeat", options->repeat, {1, kMostRepetitions},
            "Repetitions, in which the executors take turns; by default 3, or 1 with --simulate, where they take seeds "
            "SEED, SEED+1, ...")
      ->default_str("");
  CLI::Option *simulate = app.add_flag("--simulate", options->simulate, "Use virtual time instead of threads");
  add_result_arguments(app, options->run);
  add_simulator_arguments(app, options->run);
  add_thread_arguments(app, options->run);
  for (const char *name : {"--overhead-release", "--overhead-dispatch", "--overhead-preempt"}) {
    option_named(app, name).needs(simulate);
  }
  for (const char *name : {"--affinity", "--mlockall", "--realtime", "--spin", "--watchdog"}) {
    option_named(app, name).excludes(simulate);
  }
  const std::string group = "Recorded results";
  add_number(app, "--tolerance", options->recorded.tolerance, {0, kMostTolerance},
             "Share by which response percentiles may differ and still count as equal")
      ->needs(other)
      ->group(group);
  app.add_flag("--different", options->recorded.different,
               "Compare results of different workloads, for the tasks that both have")
      ->needs(other)
      ->group(group);
  app.add_flag("--all-tasks", options->recorded.all_tasks, "Show every task, however many there are")
      ->needs(other)
      ->group(group);
  option_named(app, "--check")
      .description(
          "Exit with status 1 if the first executor missed a deadline, or any figure of B is significantly worse");
  return [options, &app](Console &console) { return compare(*options, app, console); };
}

}  // namespace redag::cli
