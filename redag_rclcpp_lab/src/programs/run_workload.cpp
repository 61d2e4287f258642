// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// `ros2 run redag_rclcpp_lab run_workload` runs a workload as real ROS 2 nodes on one executor, or on several in turn.
#include <fmt/format.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <charconv>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <map>
#include <optional>
#include <system_error>

#include "rclcpp/rclcpp.hpp"
#include "redag/base/check.hpp"
#include "redag/base/text.hpp"
#include "redag/model/clusters.hpp"
#include "redag/model/workload_yaml.hpp"
#include "redag/trace/events_file.hpp"
#include "redag_analysis/metrics/summary.hpp"
#include "redag_analysis/text/table.hpp"
#include "workload_run.hpp"

namespace redag_rclcpp::lab {
namespace {

namespace fs = std::filesystem;
using redag::Duration;
using redag::metrics::Distribution;

constexpr int kExitOk = 0;
constexpr int kExitNo = 1;
constexpr int kExitBad = 2;

constexpr const char *kHelp = R"(Runs a workload as real ROS 2 nodes with synthetic callbacks, and measures
every job.

Usage: run_workload [OPTIONS] WORKLOAD.yaml

Options:
  --executor NAME[,NAME...]  Executors (default: redag). ReDAG-RT: redag (with
                             the workload's preemption), redag-none,
                             redag-cooperative, redag-os. Of rclcpp: mte, ste,
                             static, events. EventsCBGExecutor, if built: cbg.
                             Several run in turn, each in its own process, and
                             are compared.
  --duration TIME            Time in which jobs are released (default: 10s)
  --warm-up TIME             Do not count jobs released in this time at the
                             start (default: 0)
  --seed N                   Seed of execution times; every executor gets the
                             same jobs (default: 1)
  --transport intra|inter    Send messages within the process, or through the
                             middleware (default: intra)
  --threads N                Threads of the executor (default: the workload's
                             workers; ste, static and events have one)
  --repeat N                 Repetitions, in which the executors take turns
                             (default: 1)
  --out DIR                  Folder for result files, as of 'redag run'; with
                             several runs, DIR/EXECUTOR/REPETITION
  --force                    Write into a folder that is not empty
  --help                     Print this help message and exit

There is a node for each task (such as /control/ekf), a wall timer for each
timer task, and a topic for each task with successors. A release is a point of
the timer's grid, or the end of the last predecessor. A release that never ran
is a miss. Ctrl-C ends the run early and shows the results so far.

Examples:
  ros2 run redag_rclcpp_lab run_workload workloads/hello.yaml --executor mte,ste
  ros2 run redag_rclcpp_lab run_workload workloads/hello.yaml --out results
  redag check-trace results/scheduler_events.redag

Exit status: 0 success; 1 a trace breaks rules of the model; 2 bad input, or
the machine or ROS 2 refused the run.
)";

struct Arguments {
  std::string file;
  std::vector<std::string> executors = {"redag"};
  WorkloadRunOptions run;
  std::uint32_t repeat = 1;
  std::string folder;
  bool force = false;
  bool help = false;
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

void handle_signals() {
  struct sigaction action {};
  action.sa_handler = on_signal;
  action.sa_flags = SA_RESTART;
  sigemptyset(&action.sa_mask);
  for (const int number : {SIGINT, SIGTERM}) {
    REDAG_CHECK(sigaction(number, &action, nullptr) == 0, "cannot install a signal handler");
  }
}

// ---- arguments ----

redag::Result<std::uint64_t> parse_count(const std::string &option, const std::string &text, std::uint64_t least) {
  std::uint64_t value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size() || value < least) {
    return redag::make_error(fmt::format("{} '{}' is not a whole number of at least {}", option, text, least));
  }
  return value;
}

redag::Result<Duration> parse_time(const std::string &option, const std::string &text, Duration least) {
  const redag::Result<Duration> value = redag::parse_duration(text);
  if (!value) {
    return redag::make_error(fmt::format("{} '{}': {}", option, text, value.error().front().message),
                             value.error().front().hint);
  }
  if (*value < least) return redag::make_error(fmt::format("{} '{}' is too short", option, text));
  return *value;
}

redag::Result<std::vector<std::string>> parse_executors(std::string_view list) {
  std::vector<std::string> names;
  for (bool more = true; more;) {
    const std::size_t comma = list.find(',');
    const std::string name(list.substr(0, comma));
    if (auto known = check_executor(name); !known) return tl::unexpected(known.error());
    if (std::find(names.begin(), names.end(), name) != names.end()) {
      return redag::make_error(fmt::format("executor '{}' is listed twice", name));
    }
    names.push_back(name);
    more = comma != std::string_view::npos;
    if (more) list.remove_prefix(comma + 1);
  }
  return names;
}

// Parses the value of one option into `arguments`.
redag::Result<void> take_option(const std::string &name, const std::string &value, Arguments &arguments) {
  const auto keep = [](auto parsed, auto &to) -> redag::Result<void> {
    if (!parsed) return tl::unexpected(parsed.error());
    to = static_cast<std::remove_reference_t<decltype(to)>>(*std::move(parsed));
    return {};
  };
  constexpr std::uint32_t kMostThreads = 4096;
  if (name == "--executor") return keep(parse_executors(value), arguments.executors);
  if (name == "--duration") return keep(parse_time(name, value, 1), arguments.run.duration);
  if (name == "--warm-up") return keep(parse_time(name, value, 0), arguments.run.warm_up);
  if (name == "--seed") return keep(parse_count(name, value, 0), arguments.run.seed);
  if (name == "--repeat") return keep(parse_count(name, value, 1), arguments.repeat);
  if (name == "--threads") {
    const auto threads = parse_count(name, value, 1);
    if (threads && *threads > kMostThreads) {
      return redag::make_error(fmt::format("--threads '{}' is more than the maximum of {}", value, kMostThreads));
    }
    return keep(threads, arguments.run.threads);
  }
  if (name == "--out") {
    arguments.folder = value;
    return {};
  }
  if (value != "intra" && value != "inter") {
    return redag::make_error(fmt::format("--transport '{}' is neither intra nor inter", value));
  }
  arguments.run.intra_process = value == "intra";
  return {};
}

redag::Result<Arguments> parse_arguments(const std::vector<std::string> &words) {
  static const std::vector<std::string> kWithValue = {"--executor", "--duration", "--warm-up", "--seed",
                                                      "--repeat",   "--threads",  "--out",     "--transport"};
  Arguments arguments;
  for (std::size_t i = 0; i < words.size(); ++i) {
    const std::string &word = words[i];
    if (word == "--help" || word == "-h") {
      arguments.help = true;
      return arguments;
    }
    if (word == "--force") {
      arguments.force = true;
      continue;
    }
    if (word.rfind("-", 0) != 0) {
      if (!arguments.file.empty()) return redag::make_error(fmt::format("there is more than one workload: '{}'", word));
      arguments.file = word;
      continue;
    }
    const std::size_t equals = word.find('=');
    const std::string name = word.substr(0, equals);
    if (std::find(kWithValue.begin(), kWithValue.end(), name) == kWithValue.end()) {
      return redag::make_error(fmt::format("there is no option '{}'", name), "'run_workload --help' lists the options");
    }
    if (equals == std::string::npos && i + 1 == words.size()) {
      return redag::make_error(fmt::format("{} needs a value", name));
    }
    const std::string value = equals == std::string::npos ? words[++i] : word.substr(equals + 1);
    if (const redag::Result<void> taken = take_option(name, value, arguments); !taken) {
      return tl::unexpected(taken.error());
    }
  }
  if (arguments.file.empty()) return redag::make_error("no workload is given", "see 'run_workload --help'");
  if (arguments.run.warm_up >= arguments.run.duration) {
    return redag::make_error(fmt::format("a warm-up of {} leaves nothing of a run of {}",
                                         redag::format_duration(arguments.run.warm_up),
                                         redag::format_duration(arguments.run.duration)));
  }
  return arguments;
}

void note(const redag::Diagnostics &diagnostics) {
  for (const redag::Diagnostic &one : diagnostics) fmt::print(stderr, "{}\n", one.to_string());
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

// Summaries of one executor's repetitions; each holds one entry per DAG.
using Repetitions = std::vector<std::vector<redag::metrics::DagSummary>>;

double median(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  const std::size_t middle = values.size() / 2;
  return values.size() % 2 == 1 ? values[middle] : (values[middle - 1] + values[middle]) / 2;
}

// The median of a percentile of the end-to-end response, over the repetitions in which the DAG responded.
std::string percentile_text(const Repetitions &repetitions, std::size_t dag,
                            redag::Duration Distribution::*percentile) {
  std::vector<double> values;
  for (const auto &dags : repetitions) {
    const Distribution &response = dags[dag].end_to_end.response;
    if (response.count > 0) values.push_back(static_cast<double>(response.*percentile));
  }
  return values.empty() ? "-" : redag::humanize_duration(static_cast<Duration>(median(values)));
}

// The largest end-to-end response of all repetitions.
std::string longest_text(const Repetitions &repetitions, std::size_t dag) {
  std::optional<Duration> longest;
  for (const auto &dags : repetitions) {
    const Distribution &response = dags[dag].end_to_end.response;
    if (response.count > 0) longest = std::max(longest.value_or(response.max), response.max);
  }
  return longest ? redag::humanize_duration(*longest) : "-";
}

std::string comparison_table(const redag::Workload &workload, const std::vector<std::string> &executors,
                             std::map<std::string, Repetitions> &results) {
  redag::Table table({{"DAG"},
                      {"executor"},
                      {"runs", true},
                      {"jobs", true},
                      {"missed", true},
                      {"lowest", true},
                      {"highest", true},
                      {"p50", true},
                      {"p95", true},
                      {"p99", true},
                      {"max", true}});
  for (std::size_t dag = 0; dag < workload.dags.size(); ++dag) {
    for (const std::string &executor : executors) {
      const Repetitions &repetitions = results[executor];
      if (repetitions.empty()) continue;
      redag::metrics::JobCounts jobs;
      std::vector<double> missed;
      for (const auto &dags : repetitions) {
        jobs.add_counts(dags[dag].jobs);
        missed.push_back(dags[dag].jobs.miss_ratio_with_lost());
      }
      const auto [low, high] = std::minmax_element(missed.begin(), missed.end());
      table.add({{workload.dags[dag].name},
                 {executor},
                 {fmt::format("{}", repetitions.size())},
                 {fmt::format("{}", jobs.released)},
                 {redag::format_count_and_share(jobs.missed(), jobs.released)},
                 {redag::format_percent(*low)},
                 {redag::format_percent(*high)},
                 {percentile_text(repetitions, dag, &Distribution::p50)},
                 {percentile_text(repetitions, dag, &Distribution::p95)},
                 {percentile_text(repetitions, dag, &Distribution::p99)},
                 {longest_text(repetitions, dag)}});
    }
  }
  return table.render(0, false);
}

// Runs this program again for one executor, without its report. Returns its exit status.
int run_child(const Arguments &arguments, const std::string &executor, const std::string &folder) {
  const WorkloadRunOptions &run = arguments.run;
  const std::vector<std::string> words = {"run_workload",
                                          arguments.file,
                                          "--executor=" + executor,
                                          fmt::format("--duration={}ns", run.duration),
                                          fmt::format("--warm-up={}ns", run.warm_up),
                                          fmt::format("--seed={}", run.seed),
                                          std::string("--transport=") + (run.intra_process ? "intra" : "inter"),
                                          "--force",
                                          "--out=" + folder};
  std::vector<std::string> all = words;
  if (run.threads > 0) all.push_back(fmt::format("--threads={}", run.threads));
  std::vector<char *> argv;
  for (std::string &word : all) argv.push_back(word.data());
  argv.push_back(nullptr);
  const pid_t pid = fork();
  if (pid < 0) return kExitBad;
  if (pid == 0) {
    if (std::freopen("/dev/null", "w", stdout) == nullptr) _exit(kExitBad);
    execv("/proc/self/exe", argv.data());
    _exit(kExitBad);
  }
  child.store(pid);
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
      if (interrupted) break;  // a shorter run is not comparable
      real_time = real_time || trace->info.preemption == "os";
      results[executor].push_back(redag::metrics::summarize(*trace).dags);
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
  if (real_time && results.size() > 1) {
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

int run(const std::vector<std::string> &words, int argc, char **argv) {
  const redag::Result<Arguments> arguments = parse_arguments(words);
  if (!arguments) {
    note(arguments.error());
    return kExitBad;
  }
  if (arguments->help) {
    fmt::print("{}", kHelp);
    return kExitOk;
  }
  const redag::Result<redag::LoadedWorkload> loaded = redag::load_workload(arguments->file);
  if (!loaded) {
    note(loaded.error());
    return kExitBad;
  }
  if (const redag::Result<void> one = redag::refuse_clusters(loaded->workload, "run_workload"); !one) {
    note(one.error());
    return kExitBad;
  }
  if (!arguments->folder.empty()) {
    if (const redag::Result<void> made = prepare_folder(arguments->folder, arguments->force); !made) {
      note(made.error());
      return kExitBad;
    }
  }
  handle_signals();
  const bool several = arguments->executors.size() > 1 || arguments->repeat > 1;
  note(loaded->warnings);
  if (several) return run_all(loaded->workload, *arguments);
  rclcpp::init(argc, argv, rclcpp::InitOptions(), rclcpp::SignalHandlerOptions::None);
  const int status = run_once(loaded->workload, *arguments);
  rclcpp::shutdown();
  return status;
}

}  // namespace
}  // namespace redag_rclcpp::lab

int main(int argc, char **argv) {
  std::vector<std::string> words = rclcpp::remove_ros_arguments(argc, argv);
  words.erase(words.begin());
  return redag_rclcpp::lab::run(words, argc, argv);
}
