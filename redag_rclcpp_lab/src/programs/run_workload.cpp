// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// `ros2 run redag_rclcpp_lab run_workload` runs a workload as real ROS 2 nodes on one executor, or on several in turn.
#include <fmt/format.h>
#include <pthread.h>
#include <stdlib.h>

#include <algorithm>
#include <atomic>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <system_error>
#include <vector>

#include "command_line.hpp"
#include "common_start.hpp"
#include "rclcpp/rclcpp.hpp"
#include "redag/base/check.hpp"
#include "redag/base/text.hpp"
#include "redag/model/clusters.hpp"
#include "redag/model/workload_yaml.hpp"
#include "redag/runtime/threads.hpp"
#include "redag/trace/events_file.hpp"
#include "redag_analysis/metrics/summary.hpp"
#include "workload_comparison.hpp"
#include "workload_part.hpp"
#include "workload_run.hpp"

namespace redag_rclcpp::lab {
namespace {

namespace fs = std::filesystem;
// From the last process that is ready to time 0. Executors agree on one order in less than half of it.
constexpr redag::Duration kStartMargin = redag::kSecond;
constexpr const char *kDescription =
    R"(Runs a workload as real ROS 2 nodes with synthetic callbacks, and measures
every job.
)";

constexpr const char *kFooter = R"(There is a node for each task (such as /control/ekf), a wall timer for each
timer task, and a topic for each task with successors. A release is a point of
the timer's grid, or the end of the last predecessor. A release that never ran
is a miss. Ctrl-C ends the run early and shows the results so far.

Examples:
  ros2 run redag_rclcpp_lab run_workload workloads/hello.yaml --executor mte,ste
  ros2 run redag_rclcpp_lab run_workload workloads/hello.yaml --out results
  redag check-trace results/scheduler_events.redag

Exit status: 0 success; 1 a trace breaks rules of the model; 2 bad input, or
the machine or ROS 2 refused the run.)";

struct Arguments {
  std::string file;
  std::vector<std::string> executors = {"redag"};
  WorkloadRunOptions run;
  std::uint32_t repeat = 1;
  std::string folder;
  bool force = false;
  bool in_step = false;  // started by run_together()
};

std::atomic<bool> interrupted{false};

// ---- arguments ----

/// An executor as --executor names it: `mte`, or `mte-split` for a process for each DAG.
struct Contender {
  explicit Contender(const std::string &name) : executor(name) {
    constexpr std::string_view kSplit = "-split";
    if (name.size() < kSplit.size() || name.compare(name.size() - kSplit.size(), kSplit.size(), kSplit) != 0) return;
    executor.resize(name.size() - kSplit.size());
    split = true;
  }
  std::string executor;
  bool split = false;
};

bool is_split(const std::string &name) { return Contender(name).split; }

void check_executors(const std::vector<std::string> &names) {
  for (auto name = names.begin(); name != names.end(); ++name) {
    if (const auto known = check_executor(Contender(*name).executor); !known) {
      const redag::Diagnostic &mistake = known.error().front();
      throw CLI::ValidationError("--executor", fmt::format("{} ({})", mistake.message, mistake.hint));
    }
    if (std::find(names.begin(), name, *name) != name) {
      throw CLI::ValidationError("--executor", fmt::format("'{}' is listed twice", *name));
    }
  }
}

void add_options(CLI::App &app, Arguments &arguments) {
  constexpr std::uint32_t kMostThreads = 4096;
  WorkloadRunOptions &run = arguments.run;
  app.add_option("WORKLOAD", arguments.file, "A workload file")->type_name("FILE")->required();
  add_list(app, "--executor", arguments.executors,
           "Executors (default: redag). ReDAG-RT: redag (with\n"
           "the workload's preemption), redag-none,\n"
           "redag-cooperative, redag-os. Of rclcpp: mte, ste,\n"
           "static, events. If built: cbg (EventsCBGExecutor).\n"
           "Several run in turn, each in its own process, and\n"
           "are compared. With '-split' behind a name, as in\n"
           "mte-split, each DAG has a process of its own;\n"
           "redag with os then shares one order.");
  add_time(app, "--duration", run.duration, 1, "Time in which jobs are released");
  add_time(app, "--warm-up", run.warm_up, 0, "Do not count jobs released in this time at\nthe start");
  add_number<std::uint64_t>(app, "--seed", run.seed, 0, "Seed of execution times; every executor gets the\nsame jobs");
  app.add_option_function<std::string>(
         "--transport", [&run](const std::string &name) { run.intra_process = name == "intra"; },
         "Send messages within the process, or through the\nmiddleware (inter)")
      ->type_name("intra|inter")
      ->default_str("intra")
      ->check(CLI::Validator(CLI::IsMember({"intra", "inter"})).description(""));
  add_number<std::uint32_t>(
      app, "--threads", run.threads, 1,
      "Threads of the executor (default: the workload's\nworkers; ste, static and events have one)", kMostThreads)
      ->default_str("");
  add_number<std::uint32_t>(app, "--repeat", arguments.repeat, 1, "Repetitions, in which the executors take turns");
  app.add_option("--out", arguments.folder,
                 "Folder for result files, as of 'redag run'; with\n"
                 "several runs, DIR/EXECUTOR/REPETITION, and with\n"
                 "-split DIR/EXECUTOR/REPETITION/DAG")
      ->type_name("DIR");
  app.add_flag("--force", arguments.force, "Write into a folder that is not empty");
  // For the processes that a comparison starts.
  app.add_flag("--in-step", arguments.in_step)->group("");
  app.add_option("--only-dag", run.only_dag)->group("");
  app.callback([&] {
    check_executors(arguments.executors);
    if (run.warm_up >= run.duration) {
      throw CLI::ValidationError("--warm-up",
                                 fmt::format("{} leave nothing of a run of {}", redag::format_duration(run.warm_up),
                                             redag::format_duration(run.duration)));
    }
  });
}

redag::Result<void> prepare_folder(const std::string &folder, bool force) {
  std::error_code error;
  fs::create_directories(folder, error);
  if (error) return redag::make_error(fmt::format("cannot create the folder '{}': {}", folder, error.message()));
  if (!force && !fs::is_empty(folder, error)) {
    return redag::make_error(fmt::format("the folder '{}' is not empty", folder),
                             "choose another folder, or write into it with --force");
  }
  return {};
}

// ---- one run ----

int run_once(const redag::Workload &workload, const Arguments &arguments) {
  WorkloadRunOptions options = arguments.run;
  options.executor = arguments.executors.front();
  options.stop = &interrupted;
  if (arguments.in_step) options.start = await_start;
  const redag::Result<WorkloadRun> run = run_as_nodes(workload, options);
  if (!run) {
    note(run.error());
    return kExitBad;
  }
  for (const std::string &warning : run->warnings) fmt::print(stderr, "warning: {}\n", warning);
  if (!arguments.in_step) fmt::print("{}", describe(*run));
  if (!arguments.folder.empty()) {
    const redag::Diagnostics problems = write_results(*run, arguments.folder);
    note(problems);
    if (!problems.empty()) return kExitBad;
  }
  const bool lawful = run->check.ok() && (!run->scheduler || run->scheduler->check.ok());
  return lawful ? kExitOk : kExitNo;
}

// ---- several runs, compared ----

// The command that runs this program for one executor. `dag`: position from 1, or 0 for the whole workload.
std::vector<std::string> command_of(const Arguments &arguments, const std::string &executor, std::size_t dag,
                                    const std::string &folder) {
  const WorkloadRunOptions &run = arguments.run;
  std::vector<std::string> words = {fs::read_symlink("/proc/self/exe").string(),
                                    arguments.file,
                                    "--executor=" + executor,
                                    fmt::format("--duration={}ns", run.duration),
                                    fmt::format("--warm-up={}ns", run.warm_up),
                                    fmt::format("--seed={}", run.seed),
                                    std::string("--transport=") + (run.intra_process ? "intra" : "inter"),
                                    "--force",
                                    "--out=" + folder,
                                    "--in-step",
                                    fmt::format("--only-dag={}", dag)};
  if (run.threads > 0) words.push_back(fmt::format("--threads={}", run.threads));
  return words;
}

/// One repetition with one contender.
struct Repetition {
  int status = kExitBad;
  std::vector<redag::metrics::DagSummary> dags;
  bool real_time = false;  // some process ran with preemption os
};

// Runs one repetition in a process, or in one for each DAG, and reads the results from `folder`.
Repetition run_repetition(const redag::Workload &workload, const Arguments &arguments, const std::string &name,
                          const std::string &folder) {
  const Contender contender(name);
  std::vector<std::string> folders;
  std::vector<std::vector<std::string>> commands;
  for (std::size_t dag = 0; dag < (contender.split ? workload.dags.size() : 1); ++dag) {
    folders.push_back(contender.split ? fmt::format("{}/{}", folder, folder_of_part(workload, dag)) : folder);
    commands.push_back(command_of(arguments, contender.executor, contender.split ? dag + 1 : 0, folders.back()));
  }
  Repetition repetition;
  const redag::Result<std::vector<int>> statuses =
      run_together(commands, kStartMargin, [] { return interrupted.load(); });
  if (!statuses) {
    note(statuses.error());
    return repetition;
  }
  int worst = kExitOk;
  for (const int status : *statuses)
    worst = std::max(worst, status == kExitOk || status == kExitNo ? status : kExitBad);
  if (worst == kExitBad) return repetition;
  for (const std::string &place : folders) {
    const redag::Result<redag::trace::Trace> trace = redag::trace::read_trace(place + "/events.redag");
    if (!trace) {
      note(trace.error());
      return repetition;
    }
    const std::vector<redag::metrics::DagSummary> dags = redag::metrics::summarize(*trace).dags;
    repetition.dags.insert(repetition.dags.end(), dags.begin(), dags.end());
    repetition.real_time = repetition.real_time || trace->info.preemption == "os";
  }
  repetition.status = worst;
  return repetition;
}

int compare(const redag::Workload &workload, const Arguments &arguments, const std::string &folder) {
  std::map<std::string, Repetitions> results;
  bool failed = false;
  bool lawful = true;
  bool real_time = false;
  for (std::uint32_t repetition = 0; repetition < arguments.repeat && !interrupted && !failed; ++repetition) {
    for (const std::string &executor : arguments.executors) {
      if (interrupted) break;
      fmt::print(stderr, "{} of {}: {}\n", repetition + 1, arguments.repeat, executor);
      const std::string place = fmt::format("{}/{}/{}", folder, executor, repetition + 1);
      const Repetition run = run_repetition(workload, arguments, executor, place);
      if (interrupted) break;  // a shorter run is not comparable
      if (run.status == kExitBad) {
        fmt::print(stderr, "error: the run with executor {} failed\n", executor);
        failed = true;
        break;
      }
      if (run.status == kExitNo) {
        fmt::print(stderr, "error: {} broke the model's rules: see check.json in {}\n", executor, place);
        lawful = false;
      }
      real_time = real_time || run.real_time;
      results[executor].push_back(run.dags);
    }
  }
  if (!results.empty()) {
    fmt::print("{}: {} repetition{} of {} as ROS 2 nodes, {} transport, seed {}\n\n{}", workload.name, arguments.repeat,
               arguments.repeat == 1 ? "" : "s", redag::humanize_duration(arguments.run.duration),
               arguments.run.intra_process ? "intra-process" : "middleware", arguments.run.seed,
               comparison_table(workload, arguments.executors, results));
    fmt::print(
        "missed: late, skipped or aborted jobs, of the released jobs of all runs\n"
        "lowest, highest: smallest and largest share of a run\n"
        "p50 to max: end to end, from the release of a source to the finish of a sink;\n"
        "with several sinks, each figure is that of the worst one\n"
        "max is the largest of all runs; p50 to p99 are medians of the runs\n");
  }
  const bool all_are_real_time = redag::runtime::fifo_priority(pthread_self()) > 0;  // they inherit it, as by chrt
  if (real_time && !all_are_real_time && results.size() > 1) {
    fmt::print(
        "note: redag with preemption os had real-time (SCHED_FIFO) threads, the others not:\non a busy machine, this "
        "alone explains part of the difference\n");
  }
  if (interrupted) fmt::print("stopped early: only whole runs are shown\n");
  if (failed) return kExitBad;
  return lawful ? kExitOk : kExitNo;
}

int run_all(const redag::Workload &workload, const Arguments &arguments) {
  if (!arguments.folder.empty()) return compare(workload, arguments, arguments.folder);
  std::string folder = (fs::temp_directory_path() / "run_workload.XXXXXX").string();
  if (mkdtemp(folder.data()) == nullptr) {
    fmt::print(stderr, "error: cannot create a folder in {}\n", fs::temp_directory_path().string());
    return kExitBad;
  }
  const int status = compare(workload, arguments, folder);
  std::error_code ignored;
  fs::remove_all(folder, ignored);
  return status;
}

int run(int argc, char **argv) {
  Arguments arguments;
  CLI::App app(kDescription, "run_workload");
  app.footer(kFooter);
  add_options(app, arguments);
  if (const std::optional<int> status = parse_arguments(app, argc, argv)) return *status;
  const redag::Result<redag::LoadedWorkload> loaded = redag::load_workload(arguments.file);
  if (!loaded) {
    note(loaded.error());
    return kExitBad;
  }
  if (const redag::Result<void> one = redag::refuse_clusters(loaded->workload, "run_workload"); !one) {
    note(one.error());
    return kExitBad;
  }
  if (arguments.run.only_dag > loaded->workload.dags.size()) {
    note(
        redag::make_error(fmt::format("there is no DAG {} of {}", arguments.run.only_dag, loaded->workload.dags.size()))
            .value());
    return kExitBad;
  }
  if (!arguments.folder.empty()) {
    if (const redag::Result<void> made = prepare_folder(arguments.folder, arguments.force); !made) {
      note(made.error());
      return kExitBad;
    }
  }
  if (std::any_of(arguments.executors.begin(), arguments.executors.end(), is_split)) {
    if (const redag::Result<void> possible = check_parts(loaded->workload); !possible) {
      note(possible.error());
      return kExitBad;
    }
  }
  on_interrupt([](int) { interrupted.store(true); });
  const bool several = arguments.executors.size() > 1 || arguments.repeat > 1 || is_split(arguments.executors.front());
  note(loaded->warnings);
  if (several) return run_all(loaded->workload, arguments);
  rclcpp::init(argc, argv, rclcpp::InitOptions(), rclcpp::SignalHandlerOptions::None);
  const int status = run_once(loaded->workload, arguments);
  rclcpp::shutdown();
  return status;
}

}  // namespace
}  // namespace redag_rclcpp::lab

int main(int argc, char **argv) { return redag_rclcpp::lab::run(argc, argv); }
