// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/run/session.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <memory>
#include <span>

#include "redag/derived/modes.hpp"
#include "redag/threads/threads.hpp"
#include "redag_analysis/executors/executors.hpp"
#include "redag_analysis/metrics/check/trace_checker.hpp"
#include "redag_lab/report/bounds.hpp"
#include "redag_lab/run/run_workload.hpp"

namespace redag::lab {
namespace {

Duration since(std::chrono::steady_clock::time_point begin) {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(std::chrono::steady_clock::now() - begin).count();
}

std::string describe(const sim::Overheads &overheads) {
  if (overheads.release == 0 && overheads.dispatch == 0 && overheads.preempt == 0) return {};
  return fmt::format("release {}, dispatch {}, preempt {}", format_duration(overheads.release),
                     format_duration(overheads.dispatch), format_duration(overheads.preempt));
}

trace::RunInfo describe_simulation(const Workload &workload, const Variant &variant, const SessionOptions &options) {
  trace::RunInfo info;
  info.workload = workload;
  info.executor = variant.executor;
  info.config = executors::effective_config(*executors::find_executor(variant.executor), sched::config_of(workload));
  info.config.workers = workload.platform.workers;  // configure() set those that the executor uses
  info.preemption = trace::preemption_name(info.config.preemption);
  const PreemptionMode wanted = workload.platform.preemption;
  if (wanted == PreemptionMode::Os || wanted == PreemptionMode::Auto) {
    info.preemption_why = fmt::format("{}at any instant, with no cost except --overhead-preempt",
                                      wanted == PreemptionMode::Auto ? "auto, simulated as os: " : "simulated: ");
  }
  info.driver = trace::Driver::Simulator;
  info.seed = options.seed;
  info.end = options.duration;
  info.warm_up = options.warm_up;
  info.overheads = describe(options.overheads);
  info.provenance = current_provenance();
  return info;
}

// Lets the first events of a stream pass, up to the end of an instant, and knows the time of the cut.
class Limit {
 public:
  explicit Limit(std::uint64_t most) : most_(std::max<std::uint64_t>(most, 1)) {}

  std::span<const JobEvent> admit(std::span<const JobEvent> events) {
    if (cut_ || events.empty()) return {};
    if (count_ + events.size() <= most_) {
      count_ += events.size();
      last_ = events.back().time;
      return events;
    }
    // Nothing happens between two instants. Cut before the end of that gap, the prefix is the whole trace of a shorter
    // run. At the end of the gap, a job that should have finished there would be visible.
    for (std::size_t i = 0; i < events.size(); ++i) {
      if (count_ >= most_ && events[i].time - last_ > 1) {
        cut_ = events[i].time - 1;
        return events.first(i);
      }
      ++count_;
      last_ = events[i].time;
    }
    return events;
  }

  [[nodiscard]] std::uint64_t admitted() const { return count_; }
  [[nodiscard]] std::optional<Time> cut() const { return cut_; }

 private:
  std::uint64_t most_;
  std::uint64_t count_ = 0;
  Time last_ = 0;
  std::optional<Time> cut_;
};

// Evaluates a run's events as they arrive: the summary; and of the first events the check, the files and the trace.
class Evaluation {
 public:
  /// `session` must outlive this object. `is_exact`: the run is simulated, and nothing disturbs it.
  Evaluation(Session &session, trace::RunInfo info, const SessionOptions &options, bool is_exact)
      : session_(session),
        info_(std::move(info)),
        summarizer_(info_),
        checker_(info_, metrics::rules_for(info_)),
        limit_(options.max_events),
        kept_limit_(std::min(options.max_events, kMostKeptEvents)),
        keeps_(options.keep_trace || !is_exact),
        defers_(!is_exact && options.max_events <= kMostKeptEvents),
        files_options_(options.files) {
    if (!defers_) open_files();
  }

  /// Why there are no files.
  [[nodiscard]] const Diagnostics &problems() const { return problems_; }

  /// Adds events in order of time, whole instants at once.
  void add(std::span<const JobEvent> events) {
    session_.events += events.size();
    summarizer_.add(events);
    const std::span<const JobEvent> admitted = limit_.admit(events);
    if (!defers_) examine(admitted);
    if (!keeps_) return;
    const std::span<const JobEvent> kept = kept_limit_.admit(admitted);
    session_.trace.events.insert(session_.trace.events.end(), kept.begin(), kept.end());
  }

  /// Misses so far, by DAG.
  [[nodiscard]] const std::vector<std::uint64_t> &missed() const { return summarizer_.missed(); }

  /// `info` is that of the whole run. Call finish() once, at the end.
  void finish(trace::RunInfo info) {
    if (defers_) {
      open_files();
      examine(session_.trace.events);
    }
    info_.lost_events = info.lost_events;  // the other fields were known before the first event
    session_.summary = summarizer_.finish(info.end);
    session_.checked = limit_.admitted();
    session_.cut_at = limit_.cut();
    session_.check = checker_.finish(session_.cut_at.value_or(info.end), info.lost_events);
    session_.trace.info = info;
    session_.trace.info.end = kept_limit_.cut().value_or(session_.cut_at.value_or(info.end));
    session_.info = std::move(info);
    session_.files = std::move(files_);
  }

 private:
  void open_files() {
    if (files_options_.folder.empty()) return;
    Result<metrics::RunFiles> files = metrics::RunFiles::create(files_options_, info_);
    if (files) {
      files_ = std::make_unique<metrics::RunFiles>(*std::move(files));
    } else {
      problems_ = std::move(files.error());
    }
  }

  void examine(std::span<const JobEvent> events) {
    checker_.add(events);
    if (files_) files_->add(events);
  }

  Session &session_;
  trace::RunInfo info_;
  metrics::Summarizer summarizer_;
  metrics::TraceChecker checker_;
  Limit limit_;
  Limit kept_limit_;
  bool keeps_;
  bool defers_;  // examines the events after the run
  metrics::FilesOptions files_options_;
  std::unique_ptr<metrics::RunFiles> files_;
  Diagnostics problems_;
};

Result<Session> simulate(const Workload &workload, const Variant &variant, SessionOptions options,
                         const ProgressHook &progress) {
  if (options.calibration) {
    const bool ours = executors::find_executor(variant.executor)->ours;
    const Result<Overheads> machine = options.calibration->of(ours && is_realtime(workload.platform.preemption));
    if (!machine) return tl::unexpected(machine.error());
    options.overheads = sim::overheads_of(*machine);
  }
  Session session;
  trace::RunInfo info = describe_simulation(workload, variant, options);
  Evaluation evaluation(session, info, options, true);
  if (!evaluation.problems().empty()) return tl::unexpected<Diagnostics>(evaluation.problems());
  std::uint64_t batches = 0;
  const auto sink = [&](std::span<const JobEvent> events) {
    evaluation.add(events);
    if (progress) {
      constexpr std::uint64_t kLookEvery = 256;  // a clock reading at each instant would be most of the work
      if (++batches % kLookEvery == 0 && !events.empty()) progress(events.back().time, evaluation.missed());
    }
    return options.stop == nullptr || !options.stop->load(std::memory_order_relaxed);
  };
  sim::Options simulator;
  simulator.horizon = options.duration;
  simulator.seed = options.seed;
  simulator.overheads = options.overheads;
  simulator.demand = options.demand;
  simulator.gap = options.gap;
  const auto scheduler = executors::make_scheduler(variant.executor, workload, info.config, options.ranks);
  const sim::Result result = sim::simulate(workload, *scheduler, info.config.workers, simulator, sink);

  session.stopped = result.end < options.duration;
  info.end = result.end;
  evaluation.finish(std::move(info));
  return session;
}

/// Returns bounds on response times by task, 0 where there is none, for the live page. Skips large workloads, whose
/// bounds would delay the start.
std::vector<Duration> bounds_of(const Workload &workload, const Variant &variant, const sched::Config &config) {
  constexpr std::size_t kMostTasks = 100;
  std::vector<Duration> bounds(workload.task_count(), 0);
  if (bounds.size() > kMostTasks) return bounds;
  trace::RunInfo run;
  run.workload = workload;
  run.executor = variant.executor;
  run.config = config;
  const report::RunBounds found = report::bounds_of(run);
  for (std::size_t t = 0; t < found.tasks.size(); ++t) bounds[t] = found.tasks[t].response.value_or(0);
  return bounds;
}

Result<Session> run_on_threads(const Workload &workload, const Variant &variant, const SessionOptions &options,
                               const ProgressHook &progress) {
  RunOptions run;
  static_cast<RunSettings &>(run) = options;
  run.executor = variant.executor;
  run.preemption = workload.platform.preemption;
  run.realtime_threads |= variant.realtime_threads;
  if (options.watchdog > 0) run.watchdog = runtime::WatchdogOptions{{options.watchdog, 0}, 10 * kMillisecond};
  run.bounds = [&](const sched::Config &config) { return bounds_of(workload, variant, config); };
  run.scheduler = [&](const Workload &w, const sched::Config &config) {
    return executors::make_scheduler(variant.executor, w, config);
  };
  const auto is_realtime_run = [&run](const trace::RunInfo &info) {
    return run.realtime_threads || info.preemption == to_string(PreemptionMode::Os);
  };
  const auto charged = [&](trace::RunInfo info) {
    if (!options.calibration) return info;
    const Result<Overheads> machine = options.calibration->of(is_realtime_run(info));
    if (machine) info.overheads = to_string(*machine);
    return info;
  };
  Session session;
  std::optional<Evaluation> evaluation;
  run.sink = [&](const trace::RunInfo &info, std::span<const JobEvent> events) {
    if (!evaluation) evaluation.emplace(session, charged(info), options, false);
    evaluation->add(events);
  };
  if (progress) run.progress = [&](Time now, std::span<const JobEvent>) { progress(now, evaluation->missed()); };
  Result<RunResult> result = run_workload(workload, run);
  if (!result) return tl::unexpected<Diagnostics>(std::move(result.error()));

  const bool realtime_threads = is_realtime_run(result->trace.info);
  if (options.calibration) {
    if (const Result<Overheads> machine = options.calibration->of(realtime_threads); !machine)
      result->warnings.push_back(machine.error().front().message + ": no overheads are charged");
  }
  evaluation->finish(charged(std::move(result->trace.info)));
  if (!evaluation->problems().empty()) return tl::unexpected<Diagnostics>(evaluation->problems());
  session.realtime_threads = realtime_threads;
  session.stopped = result->stopped;
  session.warnings = std::move(result->warnings);
  if (!result->overdue.empty()) {
    session.warnings.push_back(fmt::format("{} job{} in progress for more than {}", result->overdue.size(),
                                           result->overdue.size() == 1 ? " was" : "s were",
                                           format_duration(options.watchdog)));
  }
  return session;
}

}  // namespace

Result<Session> run_session(const Workload &workload, const Variant &variant, const SessionOptions &options,
                            const ProgressHook &progress) {
  const auto begin = std::chrono::steady_clock::now();
  const Result<Workload> configured = configure(workload, variant);
  if (!configured) return tl::unexpected<Diagnostics>(configured.error());
  const bool is_simulated = options.driver == trace::Driver::Simulator;
  const Result<void> one_mode = refuse_separate_modes(*configured, is_simulated ? "the simulator" : "an executor");
  if (!one_mode) return tl::unexpected<Diagnostics>(one_mode.error());
  Result<Session> session = is_simulated ? simulate(*configured, variant, options, progress)
                                         : run_on_threads(*configured, variant, options, progress);
  if (!session) return session;
  session->elapsed = since(begin);
  return session;
}

std::optional<std::string> busy_machine_warning() {
  double load = 0;
  const std::size_t cpus = runtime::usable_cpus().size();
  // Half a processor each; an idle desktop stays below this load.
  if (getloadavg(&load, 1) != 1 || load < 0.5 * static_cast<double>(cpus)) return std::nullopt;
  return fmt::format("the load average is {:.1f} on {} processor(s): other programs disturb the measurements", load,
                     cpus);
}

Duration sensible_duration(const Workload &workload) {
  constexpr Duration kUsual = 10 * kSecond;
  constexpr double kMostJobs = 4e6;  // a few seconds of computation
  double jobs_a_second = 0;
  for (const TaskRef &ref : flatten(workload)) {
    if (ref.task->period > 0) jobs_a_second += static_cast<double>(kSecond) / static_cast<double>(ref.task->period);
  }
  const Duration least =
      jobs_a_second * 10 <= kMostJobs
          ? kUsual
          : std::max<Duration>(1, static_cast<Duration>(kMostJobs / jobs_a_second * static_cast<double>(kSecond)));
  const std::optional<Duration> hyperperiod = sim::hyperperiod(workload, 6 * least);
  if (!hyperperiod || *hyperperiod <= 0) return least;
  return (least + *hyperperiod - 1) / *hyperperiod * *hyperperiod;
}

}  // namespace redag::lab
