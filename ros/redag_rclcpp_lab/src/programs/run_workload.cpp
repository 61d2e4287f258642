// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// `ros2 run redag_rclcpp_lab run_workload` runs a workload as real ROS 2 nodes on one executor, or on several in turn.
#include <fmt/format.h>
#include <pthread.h>
#include <stdlib.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <system_error>
#include <vector>

#include "command_line.hpp"
#include "rclcpp/rclcpp.hpp"
#include "redag/base/check.hpp"
#include "redag/base/text.hpp"
#include "redag/derived/clusters.hpp"
#include "redag/loader/workload_yaml.hpp"
#include "redag/threads/threads.hpp"
#include "redag/trace/events_file.hpp"
#include "redag_analysis/metrics/summary.hpp"
#include "redag_analysis/text/words.hpp"
#include "workload_comparison.hpp"
#include "workload_run.hpp"

namespace redag_rclcpp::lab {
namespace {

namespace fs = std::filesystem;
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
  redag events --check results/scheduler_events.redag

Exit status: 0 success; 1 a trace breaks rules of the model; 2 bad input, or
the machine or ROS 2 refused the run.)";

struct Arguments {
  std::string file;
  std::vector<std::string> executors = {"redag"};
  WorkloadRunOptions run;
  std::uint32_t repeat = 1;
  std::string folder;
  bool force = false;
};

// ---- signals ----

std::atomic<bool> interrupted{false};
std::atomic<pid_t> child{0};

// Async-signal-safe. Passes the signal on to the child: kill(1) reaches this process alone, while the terminal's
// signals reach both.
void on_signal(int number) {
  interrupted.store(true);
  if (const pid_t to = child.load(); to > 0) kill(to, number);
}

// ---- arguments ----

void check_executors(const std::vector<std::string> &names) {
  for (auto name = names.begin(); name != names.end(); ++name) {
    if (const auto known = check_executor(*name); !known) {
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
           "are compared.");
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
                 "Folder for result files, as of 'redag run'; with\nseveral runs, DIR/EXECUTOR/REPETITION")
      ->type_name("DIR");
  app.add_flag("--force", arguments.force, "Write into a folder that is not empty");
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
  const redag::Result<WorkloadRun> run = run_as_nodes(workload, options);
  if (!run) {
    note(run.error());
    return kExitBad;
  }
  for (const std::string &warning : run->warnings) fmt::print(stderr, "warning: {}\n", warning);
  fmt::print("{}", describe(*run));
  if (!arguments.folder.empty()) {
    const redag::Diagnostics problems = write_results(*run, arguments.folder);
    note(problems);
    if (!problems.empty()) return kExitBad;
  }
  const bool lawful = run->check.ok() && (!run->scheduler || run->scheduler->check.ok());
  return lawful ? kExitOk : kExitNo;
}

// ---- several runs, compared ----

// Runs this program again for one executor, without its report. Returns its exit status.
int run_child(const Arguments &arguments, const std::string &executor, const std::string &folder) {
  const WorkloadRunOptions &run = arguments.run;
  std::vector<std::string> words = {"run_workload",
                                    arguments.file,
                                    "--executor=" + executor,
                                    fmt::format("--duration={}ns", run.duration),
                                    fmt::format("--warm-up={}ns", run.warm_up),
                                    fmt::format("--seed={}", run.seed),
                                    std::string("--transport=") + (run.intra_process ? "intra" : "inter"),
                                    "--force",
                                    "--out=" + folder};
  if (run.threads > 0) words.push_back(fmt::format("--threads={}", run.threads));
  std::vector<char *> argv;
  for (std::string &word : words) argv.push_back(word.data());
  argv.push_back(nullptr);
  const pid_t pid = fork();
  if (pid < 0) return kExitBad;
  if (pid == 0) {
    if (std::freopen("/dev/null", "w", stdout) == nullptr) _exit(kExitBad);
    execv("/proc/self/exe", argv.data());
    _exit(kExitBad);
  }
  child.store(pid);
  if (interrupted) kill(pid, SIGINT);  // the signal came before the child had its number
  int status = 0;
  while (waitpid(pid, &status, 0) < 0 && errno == EINTR) {
  }
  child.store(0);
  return WIFEXITED(status) ? WEXITSTATUS(status) : kExitBad;
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
      const int status = run_child(arguments, executor, place);
      if (interrupted) break;  // a shorter run is not comparable
      const redag::Result<redag::trace::Trace> trace = redag::trace::read_trace(place + "/events.redag");
      if (status == kExitBad || !trace) {
        fmt::print(stderr, "error: the run with executor {} failed\n", executor);
        if (status != kExitBad) note(trace.error());
        failed = true;
        break;
      }
      if (status == kExitNo) {
        fmt::print(stderr, "error: {} broke the model's rules: see {}/check.json\n", executor, place);
        lawful = false;
      }
      real_time = real_time || trace->info.preemption == "os";
      results[executor].push_back(redag::metrics::summarize(*trace).dags);
    }
  }
  if (!results.empty()) {
    fmt::print("{}: {} of {} as ROS 2 nodes, {} transport, seed {}\n\n{}", workload.name,
               redag::plural(arguments.repeat, "repetition"), redag::humanize_duration(arguments.run.duration),
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
  if (!arguments.folder.empty()) {
    if (const redag::Result<void> made = prepare_folder(arguments.folder, arguments.force); !made) {
      note(made.error());
      return kExitBad;
    }
  }
  on_interrupt(on_signal);
  const bool several = arguments.executors.size() > 1 || arguments.repeat > 1;
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
