// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/cli/run/run_arguments.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "redag/base/text.hpp"
#include "redag/derived/clusters.hpp"
#include "redag/derived/modes.hpp"
#include "redag/loader/cpu_list.hpp"
#include "redag/loader/provenance.hpp"
#include "redag/loader/validate.hpp"
#include "redag/loader/workload_yaml.hpp"
#include "redag/loader/workload_yaml_edit.hpp"
#include "redag/threads/threads.hpp"
#include "redag/trace/trace.hpp"
#include "redag_analysis/executors/executors.hpp"
#include "redag_lab/cli/terminal/files.hpp"
#include "redag_lab/cli/terminal/options.hpp"

namespace redag::cli {
namespace {

constexpr const char *kWorkloadGroup = "Override the workload";
constexpr const char *kResultGroup = "Results";

}  // namespace

void add_platform_arguments(CLI::App &app, RunArguments &arguments) {
  add_choice(app, "--policy", arguments.policy, choices_of<PolicyKind>(), "Priority order")->group(kWorkloadGroup);
  add_choice(app, "--ties", arguments.ties, choices_of<Ties>(), "Order of tasks with equal priority")
      ->group(kWorkloadGroup);
  add_choice(app, "--preemption", arguments.preemption, choices_of<PreemptionMode>(), "Preemption mode of ReDAG-RT")
      ->group(kWorkloadGroup);
  add_count(app, "--workers", arguments.workers, {1, kMaxWorkers}, "Number of workers")
      ->default_str("")
      ->group(kWorkloadGroup);
}

CLI::Option *add_calibration_argument(CLI::App &app, RunArguments &arguments, const std::string &group) {
  const auto read = [&arguments](const std::string &file) {
    Result<Calibration> loaded = load_calibration(file);
    if (!loaded) reject("--overheads", to_string(loaded.error()));
    set_calibration(file + ", " + loaded->provenance());
    arguments.calibration = *std::move(loaded);
  };
  return app
      .add_option_function<std::string>("--overheads", read,
                                        "Charge the overheads of the machine that 'redag doctor --measure' measured")
      ->type_name("FILE")
      ->group(group);
}

void add_overhead_arguments(CLI::App &app, RunArguments &arguments, const std::string &group) {
  CLI::Option *file = add_calibration_argument(app, arguments, group);
  const auto add = [&](const char *name, Duration &part, const char *help) {
    add_duration(app, name, part, help, true)->group(group)->excludes(file);
  };
  add("--overhead-release", arguments.overheads.release, "Processor time to handle a release");
  add("--overhead-dispatch", arguments.overheads.dispatch, "Processor time to start a job");
  add("--overhead-preempt", arguments.overheads.preempt, "Processor time to resume a preempted job");
}

void add_workload_arguments(CLI::App &app, RunArguments &arguments, const char *file_help) {
  app.add_option("FILE", arguments.file, file_help)->type_name("WORKLOAD")->required();
  add_duration(app, "--duration", arguments.duration, "Length of the run: the time in which jobs are released");
  add_duration(app, "--warm-up", arguments.warm_up, "Do not count jobs released in this time at the start", true);
  add_seed(app, arguments.seed, "Seed of execution times and jitter; every executor gets the same jobs");
  add_platform_arguments(app, arguments);
}

void add_result_arguments(CLI::App &app, RunArguments &arguments) {
  app.add_flag("--json", arguments.json, "Write one JSON document, and nothing else, to standard output")
      ->group(kResultGroup);
  app.add_option("--out", arguments.folder, "Folder for the result files; created if missing")
      ->type_name("DIR")
      ->group(kResultGroup);
  app.add_flag("--check", arguments.check, "Exit with status 1 if a deadline was missed")->group(kResultGroup);
  add_count(app, "--max-events", arguments.max_events, {1, kMaxEvents},
            "Number of events to check and write; later events count in the summary only")
      ->group(kResultGroup);
}

void add_simulator_arguments(CLI::App &app, RunArguments &arguments) {
  const std::string group = "Simulator";
  add_overhead_arguments(app, arguments, group);
}

void add_thread_arguments(CLI::App &app, RunArguments &arguments) {
  const std::string group = "Threads";
  app.add_option("--affinity", arguments.cpus, "Processors of the workers, such as 2,3 or 0-3")
      ->type_name("CPUS")
      ->group(group);
  app.add_flag("--mlockall", arguments.lock_memory, "Lock all memory, to avoid page faults during the run")
      ->group(group);
  app.add_flag("--realtime", arguments.realtime_threads,
               "Use SCHED_FIFO threads for every executor, also for those that do not preempt")
      ->group(group);
  add_duration(app, "--spin", arguments.spin,
               "Time for which an idle worker looks for a job before it sleeps; not with preemption os", true)
      ->group(group);
  add_duration(app, "--watchdog", arguments.watchdog,
               "Report jobs that are in progress for longer than this, while they still run")
      ->group(group);
}

std::optional<Workload> load_configured(const RunArguments &arguments, Console &console, LoadOptions options,
                                        std::string *source) {
  Result<robot::Input> input = load_workload_or_robot(arguments.file, options, source);
  if (!ok(input, console)) return std::nullopt;
  console.note(input->loaded.warnings);
  Workload workload = std::move(input->loaded.workload);
  const bool is_unchanged = !arguments.policy && !arguments.ties && !arguments.preemption && arguments.workers == 0;
  if (is_unchanged) return workload;
  if (arguments.policy) workload.policy = *arguments.policy;
  if (arguments.ties) workload.ties = *arguments.ties;
  if (arguments.preemption) workload.platform.preemption = *arguments.preemption;
  if (arguments.workers > 0 && !workload.platform.clusters.empty()) {
    console.error("--workers: the platform has clusters, each with workers of its own",
                  "change 'workers:' of the clusters in the file");
    return std::nullopt;
  }
  if (arguments.workers > 0) workload.platform.workers = arguments.workers;
  // The file was valid. Mistakes found now come from the command line and have no line number.
  const Diagnostics mistakes = validate(workload, options);
  if (!has_errors(mistakes)) return workload;
  for (const Diagnostic &mistake : mistakes) {
    if (mistake.severity == Severity::Error) console.note(mistake);
  }
  return std::nullopt;
}

std::optional<Workload> load_without_clusters(const RunArguments &arguments, const char *command, Console &console,
                                              std::string *source) {
  std::optional<Workload> workload = load_configured(arguments, console, {.waits = true}, source);
  if (!workload) return std::nullopt;
  for (const Result<void> &one : {refuse_clusters(*workload, command), refuse_separate_modes(*workload, command)}) {
    if (!ok(one, console)) return std::nullopt;
  }
  return workload;
}

namespace {

/// Returns `text` without the comment of the command that wrote it.
std::string_view without_provenance(std::string_view text) {
  const std::string comment = provenance_to_comment({});
  std::string_view keys = comment;  // '# created: ""' and so on, in the order in which they are written
  if (!text.starts_with(keys.substr(0, keys.find('"') + 1))) return text;
  while (!keys.empty()) {
    const std::string_view key = keys.substr(0, keys.find('"') + 1);
    if (text.starts_with(key)) text.remove_prefix(std::min(text.find('\n'), text.size() - 1) + 1);
    keys.remove_prefix(keys.find('\n') + 1);
  }
  return text;
}

}  // namespace

bool write_changed(const std::string &path, const std::string &source, const Workload &workload, Console &console) {
  if (path.empty()) return true;
  const std::string changed = edit_yaml(source, workload, {.waits = true});
  const bool is_unchanged = changed == source;
  const Result<void> written = write_text(
      path,
      is_unchanged ? source : provenance_to_comment(current_provenance()) + std::string(without_provenance(changed)));
  if (!ok(written, console)) return false;
  console.note(fmt::format("wrote {}{}\n", path, is_unchanged ? ": the unchanged workload" : ""));
  return true;
}

bool takes_arguments(const std::vector<lab::Variant> &variants, const RunArguments &arguments, Console &console) {
  const auto none = [&](const auto &takes) { return std::none_of(variants.begin(), variants.end(), takes); };
  const lab::Variant &first = variants.front();
  if (arguments.preemption && none([&](const lab::Variant &variant) {
        return !variant.preemption || variant.preemption == arguments.preemption;
      })) {
    console.error(fmt::format("--preemption {}: executor '{}' always runs with preemption {}",
                              to_string(*arguments.preemption), first.name, to_string(*first.preemption)),
                  "leave --preemption out, or choose the executor 'redag'");
    return false;
  }
  if ((arguments.policy || arguments.ties) && none([](const lab::Variant &variant) { return variant.is_redag(); })) {
    const char *option = arguments.policy ? "--policy" : "--ties";
    const std::string value = arguments.policy ? to_string(*arguments.policy) : to_string(*arguments.ties);
    console.error(fmt::format("{} {}: executor '{}' has a fixed order of its own", option, value, first.name),
                  fmt::format("leave {} out, or choose the executor 'redag'", option));
    return false;
  }
  const auto has_workers = [](const lab::Variant &variant) {
    return !executors::find_executor(variant.executor)->single_worker;
  };
  if (arguments.workers > 1 && none(has_workers)) {
    console.error(fmt::format("--workers {}: executor '{}' has only one worker", arguments.workers, first.name),
                  "leave --workers out, or choose the executor 'mte'");
    return false;
  }
  return true;
}

std::optional<lab::SessionOptions> session_options(const RunArguments &arguments, trace::Driver driver,
                                                   Duration default_duration, Console &console) {
  lab::SessionOptions options;
  options.driver = driver;
  options.duration = arguments.duration.value_or(default_duration);
  options.warm_up = arguments.warm_up;
  options.seed = arguments.seed;
  options.max_events = arguments.max_events;
  options.overheads = arguments.overheads;
  options.calibration = arguments.calibration;
  options.lock_memory = arguments.lock_memory;
  options.realtime_threads = arguments.realtime_threads;
  options.spin = arguments.spin;
  options.live = arguments.live;
  options.watchdog = arguments.watchdog.value_or(0);
  if (options.duration > trace::kMaxTraceTime) {
    console.error(fmt::format("a run of {} is longer than a trace can record", format_duration(options.duration)),
                  "choose at most " + format_duration(trace::kMaxTraceTime));
    return std::nullopt;
  }
  if (options.warm_up >= options.duration) {
    console.error(fmt::format("a warm-up of {} leaves nothing of a run of {}", format_duration(options.warm_up),
                              format_duration(options.duration)));
    return std::nullopt;
  }
  if (!arguments.cpus.empty()) {
    const std::optional<std::vector<int>> cpus = parse_cpu_list(arguments.cpus);
    if (!cpus) {
      console.error(fmt::format("--affinity: {} is not a list of processors", in_quotes(arguments.cpus)),
                    "write numbers and ranges, such as 0,2-3");
      return std::nullopt;
    }
    options.cpus = *cpus;
    if (const std::optional<int> bad = runtime::unusable_cpu(*cpus)) {
      console.error(fmt::format("--affinity: this process is not allowed to use processor {}", *bad),
                    fmt::format("allowed: {}", fmt::join(runtime::usable_cpus(), ", ")));
      return std::nullopt;
    }
  }
  if (!arguments.folder.empty()) {
    if (arguments.record) options.record = fmt::format("{}/{}", arguments.folder, trace::kEventsFile);
    options.record_bytes = std::uint64_t{arguments.record_mib} << 20U;
    if (!ok(prepare_folder(arguments.folder), console)) return std::nullopt;
  }
  return options;
}

lab::ProgressHook progress_hook(Progress &progress, const Workload &workload, Duration duration) {
  std::vector<std::string> names;
  for (const Dag &dag : workload.dags) names.push_back(dag.name);
  return [&progress, names, duration](Time now, const std::vector<std::uint64_t> &misses) {
    if (!progress.due()) return;
    std::string missed;
    for (std::size_t i = 0; i < misses.size(); ++i) {
      if (misses[i] > 0) missed += fmt::format("{} {} {}", missed.empty() ? ", misses:" : ",", names[i], misses[i]);
    }
    const Time shown = std::min(now, duration);
    const double done = static_cast<double>(shown) / static_cast<double>(duration);
    progress.draw(done, fmt::format("{} of {}{}{}", humanize_duration(shown), humanize_duration(duration),
                                    progress.left(done), missed.empty() ? ", no misses" : missed));
  };
}

}  // namespace redag::cli
