// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/run/run_workload.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <thread>
#include <utility>

#include "redag/base/lock_guard.hpp"
#include "redag/base/mutex.hpp"
#include "redag/model/clusters.hpp"
#include "redag/model/validate.hpp"
#include "redag/runtime/clock.hpp"
#include "redag/runtime/live_sample.hpp"
#include "redag/runtime/release_timer.hpp"
#include "redag/runtime/spins.hpp"
#include "redag/runtime/threads.hpp"
#include "redag_analysis/executors/executors.hpp"
#include "redag_lab/run/concurrency.hpp"
#include "redag_lab/run/synthetic.hpp"

namespace redag::lab {
namespace {

constexpr Duration kStartMargin = 20 * kMillisecond;  // from the threads being ready to time 0
constexpr Duration kCollectEvery = 100 * kMillisecond;
// Each thread has a stack and a ring of events, and every decision examines all threads.
constexpr std::uint64_t kMostThreads = 1024;

std::uint32_t pool_size(const Workload &workload, const RunOptions &options) {
  const std::uint64_t wanted = options.threads > 0 ? options.threads : std::min(most_started(workload), kMostThreads);
  return std::max(workload.platform.workers, static_cast<std::uint32_t>(wanted));
}

class Run {
 public:
  Run(const Workload &workload, const RunOptions &options) : workload_(workload), options_(options) {}

  Result<RunResult> execute() {
    const Result<void> started = prepare().and_then([&] { return record(); }).and_then([&] { return start(); });
    if (!started) {
      // A run that did not start has no record to keep.
      if (flight_) static_cast<void>(trace::remove_flight_record(options_.flight));
      return tl::unexpected<Diagnostics>(started.error());
    }
    collect_until_horizon();
    finish();
    return std::move(result_);
  }

 private:
  Result<void> prepare() {
    const executors::ExecutorKind *kind = executors::find_executor(options_.executor);
    if (kind == nullptr && !options_.scheduler) {
      return make_error(fmt::format("there is no executor '{}'", options_.executor));
    }
    Diagnostics mistakes = validate(workload_);
    std::erase_if(mistakes, [](const Diagnostic &mistake) { return mistake.severity != Severity::Error; });
    if (!mistakes.empty()) return tl::unexpected<Diagnostics>(std::move(mistakes));
    if (Result<void> one = refuse_clusters(workload_, "a run on threads"); !one) return one;
    const bool preemptive = kind == nullptr || kind->ours;
    const auto wanted = options_.preemption.value_or(workload_.platform.preemption);
    Result<runtime::Setup> setup = runtime::set_up({.preemption = preemptive ? wanted : PreemptionMode::None,
                                                    .policy = workload_.policy,
                                                    .ties = workload_.ties,
                                                    .workers = workload_.platform.workers,
                                                    .threads = pool_size(workload_, options_),
                                                    .cpus = options_.cpus});
    if (!setup) return tl::unexpected(setup.error());
    result_.mode = setup->mode;
    if (!preemptive && wanted != PreemptionMode::None) {
      result_.mode.reason = "executor " + options_.executor + " has no other";
    }
    if (options_.realtime_threads && setup->band.top_job == 0) {
      return make_error("the workers cannot be SCHED_FIFO threads, because this process may not use SCHED_FIFO",
                        runtime::realtime_hint());
    }
    const std::uint32_t spins = spins_before_sleep(*setup, options_.spin);
    result_.warnings = std::move(setup->warnings);
    const std::uint64_t most = most_started(workload_);
    if (preemptive && result_.mode.mode == PreemptionMode::Os && setup->config.max_started < most) {
      result_.warnings.push_back(
          fmt::format("{} threads serve up to {} jobs in progress: a job can wait for a thread that a less urgent job "
                      "holds, which counts as a priority inversion",
                      setup->config.max_started, most));
    }
    if (options_.lock_memory) {
      if (const Result<void> locked = redag::runtime::lock_memory(); !locked) {
        const Diagnostic &why = locked.error().front();
        result_.warnings.push_back(fmt::format("{} ({})", why.message, why.hint));
      }
    }

    runtime::EngineOptions engine;
    engine.config = setup->config;
    engine.band = setup->band;
    engine.throttling = setup->throttling;
    engine.realtime_threads = options_.realtime_threads;
    engine.cpus = options_.cpus;
    engine.trace_capacity = options_.trace_capacity;
    engine.measure = options_.live;
    engine.spins = spins;
    if (options_.lock_memory) engine.touched_stack = runtime::kTouchedStack;
    if (kind != nullptr) engine.config = executors::effective_config(*kind, engine.config);
    auto scheduler = options_.scheduler ? options_.scheduler(workload_, engine.config)
                                        : executors::make_scheduler(options_.executor, workload_, engine.config);
    engine_ = std::make_unique<runtime::Engine>(std::move(scheduler), std::move(engine));
    std::vector<runtime::Body> bodies = synthetic_bodies(workload_, options_.seed, give_up_);
    if (options_.bodies)
      bodies = options_.bodies(std::move(bodies), [engine_ptr = engine_.get()] { return engine_ptr->now(); });
    engine_->bind(workload_, std::move(bodies));
    timer_ =
        std::make_unique<runtime::ReleaseTimer>([this](auto releases) { engine_->release(releases); }, options_.seed);
    engine_->share_releases(timer_->thread());
    std::size_t next = 0;
    for (const Dag &dag : workload_.dags) {
      std::vector<TaskId> tasks;
      for (std::size_t i = 0; i < dag.tasks.size(); ++i) tasks.emplace_back(next++);
      timer_->add(dag, tasks, 0);
    }
    if (options_.live) go_live();
    return {};
  }

  void go_live() {
    std::vector<Duration> bounds;
    if (options_.bounds) bounds = options_.bounds(engine_->options().config);
    bounds.resize(workload_.task_count(), 0);
    auto publisher =
        live::Publisher::start(live_options(workload_.name, "threads", result_.mode, engine_->options().config),
                               [this, bounds = std::move(bounds)](live::Sample &sample) {
                                 for (const Dag &dag : workload_.dags)
                                   sample.dags.push_back({dag.name, dag.max_active});
                                 for (const TaskRef &ref : flatten(workload_)) {
                                   live::TaskSample task;
                                   fill(task, engine_->figures(ref.id));
                                   task.key = ref.id.value;
                                   task.name = ref.task->name;
                                   task.dag = ref.dag.value;
                                   task.period = ref.task->period;
                                   task.deadline = ref.task->deadline;
                                   task.bound = bounds[ref.id.value];
                                   sample.tasks.push_back(std::move(task));
                                 }
                               });
    if (publisher) {
      live_ = *std::move(publisher);
    } else {
      const Diagnostic &why = publisher.error().front();
      result_.warnings.push_back(fmt::format("{} ({})", why.message, why.hint));
    }
  }

  Result<void> start() {
    if (Result<void> started = engine_->start(); !started) return started;
    origin_ = runtime::monotonic_now() + kStartMargin;
    engine_->set_origin(origin_);
    const bool realtime = options_.realtime_threads || result_.mode.mode == PreemptionMode::Os;
    const int priority = realtime ? engine_->options().band.timer : 0;
    if (options_.watchdog) {
      watchdog_ = std::make_unique<runtime::Watchdog>(*engine_, *options_.watchdog,
                                                      [this](const runtime::OverdueJob &job) { note(job); });
      if (Result<void> started = watchdog_->start({"redag-watch", priority, {}}); !started) return started;
    }
    return timer_->start(origin_, options_.duration, {"redag-timer", priority, {}});
  }

  Result<void> record() {
    describe();
    if (options_.flight.empty()) return {};
    Result<trace::FlightRecorder> recorder =
        trace::FlightRecorder::create(options_.flight, result_.trace.info, options_.flight_options);
    if (!recorder) return tl::unexpected(recorder.error());
    flight_.emplace(std::move(*recorder));
    return {};
  }

  // Collects all events so far and appends the new ones to the flight record.
  void drain(bool finally) {
    auto &events = result_.trace.events;
    const std::size_t before = events.size();
    engine_->drain(events, finally);
    if (!flight_) return;
    const Result<void> kept = flight_->append(std::span(events).subspan(before), engine_->lost_events());
    if (!kept) result_.warnings.push_back(fmt::format("the flight record ends here: {}", to_string(kept.error())));
  }

  // Passes the collected events to the sink, if there is one.
  void hand_over() {
    if (!options_.sink) return;
    options_.sink(result_.trace.info, result_.trace.events);
    result_.trace.events.clear();
  }

  void note(const runtime::OverdueJob &job) {
    std::string text = fmt::format("{} #{} is overdue: {}", trace::task_name(workload_, job.job.task), job.job.number,
                                   runtime::describe(job));
    const LockGuard guard(notes_lock_);
    notes_.push_back(std::move(text));
  }

  void report_overdue() {
    std::vector<std::string> notes;
    {
      const LockGuard guard(notes_lock_);
      notes.swap(notes_);
    }
    for (std::string &text : notes) {
      if (options_.on_overdue) options_.on_overdue(text);
      result_.overdue.push_back(std::move(text));
    }
  }

  // Returns false if started jobs remain after drain_timeout.
  bool wait_idle() {
    const Time give_up = runtime::monotonic_now() + options_.drain_timeout;
    for (Time now = runtime::monotonic_now();; now = runtime::monotonic_now()) {
      const bool idle = engine_->wait_idle(std::min(now + kCollectEvery, give_up));
      report_overdue();
      if (idle || now >= give_up) return idle;
    }
  }

  void collect_until_horizon() {
    const Time end = origin_ + options_.duration;
    runtime::Event never;
    for (Time now = runtime::monotonic_now(); now < end; now = runtime::monotonic_now()) {
      if (options_.stop != nullptr && options_.stop->load()) {
        result_.stopped = true;
        break;
      }
      never.wait_until(std::min(now + kCollectEvery, end));
      drain(false);
      hand_over();
      report_overdue();
      if (options_.progress) options_.progress(engine_->now(), result_.trace.events);
    }
  }

  void finish() {
    end_ = result_.stopped ? std::clamp<Time>(engine_->now(), 0, options_.duration) : options_.duration;
    timer_->stop();  // reports releases that were due until now
    timer_->join();
    engine_->halt();
    if (!wait_idle()) {
      for (const runtime::Job &job : engine_->started()) {
        result_.unfinished.push_back(fmt::format("{} #{}", trace::task_name(workload_, job.task), job.number));
      }
      give_up_.store(true);
    }
    (void)engine_->wait_idle(kNever);
    watchdog_.reset();
    engine_->join();
    report_overdue();
    live_.reset();
    warn();
    cut();
    for (std::size_t t = 0; t < workload_.task_count(); ++t) result_.usage.push_back(engine_->usage(TaskId(t)));
  }

  void describe() {
    trace::RunInfo &info = result_.trace.info;
    info.workload = workload_;
    info.executor = options_.executor;
    info.config = engine_->options().config;
    info.preemption = to_string(result_.mode.mode);
    info.preemption_why = result_.mode.reason;
    info.driver = trace::Driver::Threads;
    info.seed = options_.seed;
    info.end = options_.duration;
    info.warm_up = options_.warm_up;
    info.machine = trace::this_machine();
    info.provenance = current_provenance();
  }

  void warn() {
    if (const Duration gave_way = engine_->gave_way(); gave_way > 0) {
      result_.warnings.push_back(
          fmt::format("jobs of lower criticality ran on ordinary threads for {}, so that the kernel's real-time "
                      "throttling did not stop those of high criticality",
                      humanize_duration(gave_way)));
    }
    if (const std::uint64_t waits = engine_->thread_waits(); waits > 0) {
      result_.warnings.push_back(fmt::format("{} time{} a job waited for a thread, because all {} had jobs in progress",
                                             waits, waits == 1 ? "" : "s", engine_->thread_count()));
    }
    if (engine_->refused_priorities() > 0) {
      result_.warnings.push_back(fmt::format("the kernel refused {} priority changes", engine_->refused_priorities()));
    }
    if (!result_.unfinished.empty()) {
      result_.warnings.push_back(fmt::format("jobs not finished {} after the end: {}",
                                             format_duration(options_.drain_timeout),
                                             fmt::join(result_.unfinished, ", ")));
    }
  }

  // The trace ends where the scheduler stopped deciding. Jobs that had started by then are in flight, as in the
  // simulator.
  void cut() {
    auto &events = result_.trace.events;
    drain(true);
    const Time end = engine_->halted_at();
    const auto after = std::find_if(events.begin(), events.end(), [&](const JobEvent &e) { return e.time >= end; });
    events.erase(after, events.end());
    hand_over();
    result_.trace.info.end = end_;
    result_.trace.info.lost_events = engine_->lost_events();
    if (result_.trace.info.lost_events > 0) {
      result_.warnings.push_back(
          fmt::format("{} events were lost: raise the trace capacity", result_.trace.info.lost_events));
    }
  }

  const Workload &workload_;
  const RunOptions &options_;
  RunResult result_;
  Mutex notes_lock_;
  std::vector<std::string> notes_ REDAG_GUARDED_BY(notes_lock_);  // from the watchdog, not yet reported
  std::atomic<bool> give_up_{false};
  std::optional<trace::FlightRecorder> flight_;
  std::unique_ptr<runtime::Engine> engine_;
  std::unique_ptr<runtime::ReleaseTimer> timer_;  // after the engine: it is destroyed first
  std::unique_ptr<runtime::Watchdog> watchdog_;   // likewise
  std::unique_ptr<live::Publisher> live_;         // after the engine, whose figures it reads until it is destroyed
  Time origin_ = 0;
  Time end_ = 0;
};

}  // namespace

Result<RunResult> run_workload(const Workload &workload, const RunOptions &options) {
  return Run(workload, options).execute();
}

}  // namespace redag::lab
