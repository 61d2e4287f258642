// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/run/run_workload.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <thread>
#include <utility>

#include "redag/base/lock_guard.hpp"
#include "redag/base/mutex.hpp"
#include "redag/derived/clusters.hpp"
#include "redag/derived/waits.hpp"
#include "redag/loader/cpu_list.hpp"
#include "redag/loader/validate.hpp"
#include "redag/runtime/live_sample.hpp"
#include "redag/runtime/release_timer.hpp"
#include "redag/runtime/spins.hpp"
#include "redag/threads/clock.hpp"
#include "redag/threads/threads.hpp"
#include "redag/trace/this_machine.hpp"
#include "redag_analysis/executors/executors.hpp"
#include "redag_lab/run/concurrency.hpp"
#include "redag_lab/run/synthetic.hpp"

namespace redag::lab {
namespace {

constexpr Duration kStartMargin = 20 * kMillisecond;  // from the threads being ready to time 0
constexpr Duration kCollectEvery = 100 * kMillisecond;
constexpr Duration kKeptBack = 50 * kMillisecond;  // far longer than a decision takes
// Each thread has a stack and a ring of events, and every decision examines all threads.
constexpr std::uint64_t kMostThreads = 1024;

std::uint32_t pool_size(const Workload &workload, const RunOptions &options) {
  const std::uint64_t wanted = options.threads > 0 ? options.threads : std::min(most_started(workload), kMostThreads);
  return std::max(workload.platform.workers, static_cast<std::uint32_t>(wanted));
}

// One scheduler with its threads: of a cluster, or of the whole platform. What is destroyed first stands last.
struct Instance {
  explicit Instance(const ClusterPart &served) : part(served) { due.reserve(sched::kMostReleasesAtOnce); }

  const ClusterPart &part;
  std::unique_ptr<runtime::Engine> engine;
  std::vector<runtime::Release> due;  // the timer's, with the cluster's ids
  std::unique_ptr<runtime::ReleaseTimer> timer;
  std::unique_ptr<runtime::Watchdog> watchdog;
};

// The name of a DAG where DAGs of all clusters are listed.
std::string shown_name(const Dag &dag) {
  return dag.cluster.empty() ? dag.name : fmt::format("{} ({})", dag.name, dag.cluster);
}

class Run {
 public:
  Run(const Workload &workload, const RunOptions &options) : workload_(workload), options_(options) {}

  Result<RunResult> execute() {
    const Result<void> started = prepare().and_then([&] { return record(); }).and_then([&] { return start(); });
    if (!started) {
      // A run that did not start has no record to keep.
      if (record_) static_cast<void>(std::remove(options_.record.c_str()));
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
    const bool preemptive = kind == nullptr || kind->ours;
    Diagnostics mistakes = validate(workload_, {.waits = preemptive});
    std::erase_if(mistakes, [](const Diagnostic &mistake) { return mistake.severity != Severity::Error; });
    if (!mistakes.empty()) return tl::unexpected<Diagnostics>(std::move(mistakes));
    const auto wanted = options_.preemption.value_or(workload_.platform.preemption);
    parts_ = parts_of(workload_);
    places_ = places_in(parts_);
    if (parts_.front().is_cluster() && !options_.cpus.empty()) {
      return make_error("the platform has clusters, whose processors are not chosen by --affinity",
                        "change 'cpus:' of the clusters in the file");
    }
    if (parts_.size() > 1 && !workload_.platform.devices.empty()) {
      return make_error("clusters that share devices can be simulated and analysed only: no executor spans clusters");
    }
    bodies_ = synthetic_bodies(workload_, options_.seed, give_up_);
    if (options_.bodies) {
      bodies_ = options_.bodies(std::move(bodies_), [this] { return instances_.empty() ? Time{0} : time_now(); });
    }
    std::uint32_t threads = 0;  // of each part: the trace states one number for all
    for (const ClusterPart &part : parts_) threads = std::max(threads, pool_size(part.workload, options_));
    for (const ClusterPart &part : parts_) {
      if (part.is_cluster() && part.dags.empty()) continue;
      if (Result<void> added = add_instance(part, kind, preemptive ? wanted : PreemptionMode::None, threads); !added) {
        return added;
      }
    }
    if (!preemptive && wanted != PreemptionMode::None) {
      result_.mode.reason = "executor " + options_.executor + " has no other";
    }
    if (options_.lock_memory) {
      if (const Result<void> locked = redag::runtime::lock_memory(); !locked) {
        const Diagnostic &why = locked.error().front();
        result_.warnings.push_back(fmt::format("{} ({})", why.message, why.hint));
      }
    }
    if (options_.live) go_live();
    return {};
  }

  Result<void> add_instance(const ClusterPart &part, const executors::ExecutorKind *kind, PreemptionMode wanted,
                            std::uint32_t threads) {
    const bool preemptive = kind == nullptr || kind->ours;
    const std::vector<int> &cpus = options_.cpus.empty() ? part.cpus : options_.cpus;
    if (const auto missing = runtime::unusable_cpu(part.cpus); missing && options_.cpus.empty()) {
      return make_error(
          fmt::format("{} has processor {}, which this process cannot use",
                      part.is_cluster() ? fmt::format("cluster '{}'", part.name) : "the platform", *missing),
          fmt::format("change 'cpus:' in the file: usable processors are {}", format_cpu_list(runtime::usable_cpus())));
    }
    Result<runtime::Setup> setup = runtime::set_up({.preemption = wanted,
                                                    .policy = workload_.policy,
                                                    .ties = workload_.ties,
                                                    .workers = part.workload.platform.workers,
                                                    .threads = threads,
                                                    .cpus = cpus});
    if (!setup) return tl::unexpected(setup.error());
    result_.mode = setup->mode;
    if (parts_.size() > 1 && cpus.empty() && setup->mode.mode == PreemptionMode::Os) {
      return make_error(fmt::format("cluster '{}' has no 'cpus', which alone keep real-time clusters apart", part.name),
                        "add 'cpus:' to each cluster, or choose preemption none or cooperative");
    }
    if (options_.realtime_threads && setup->band.top_job == 0) {
      return make_error("the workers cannot be SCHED_FIFO threads, because this process may not use SCHED_FIFO",
                        runtime::realtime_hint());
    }
    const std::uint32_t spins = spins_before_sleep(*setup, options_.spin);
    for (std::string &warning : setup->warnings) warn_once(std::move(warning));
    const std::uint64_t most = most_started(part.workload);
    if (preemptive && result_.mode.mode == PreemptionMode::Os && setup->config.max_started < most) {
      warn_once(
          fmt::format("{} threads serve up to {} jobs in progress: a job can wait for a thread that a less urgent job "
                      "holds, which counts as a priority inversion",
                      setup->config.max_started, most));
    }

    runtime::EngineOptions engine;
    engine.config = setup->config;
    engine.band = setup->band;
    engine.order_folder = setup->order_folder;
    engine.realtime_threads = options_.realtime_threads;
    engine.cpus = cpus;
    engine.trace_capacity = options_.trace_capacity;
    engine.measure = options_.live;
    engine.spins = spins;
    if (options_.lock_memory) engine.touched_stack = runtime::kTouchedStack;
    engine.waits_priority = setup->timer_priority();
    if (kind != nullptr) engine.config = executors::effective_config(*kind, engine.config);
    auto scheduler = options_.scheduler ? options_.scheduler(part.workload, engine.config)
                                        : executors::make_scheduler(options_.executor, part.workload, engine.config);
    Instance &instance = *instances_.emplace_back(std::make_unique<Instance>(part));
    instance.engine = std::make_unique<runtime::Engine>(std::move(scheduler), std::move(engine));
    std::vector<runtime::Body> bodies;
    for (const TaskId task : part.tasks) bodies.push_back(std::move(bodies_[task.value]));
    instance.engine->bind(part.workload, std::move(bodies));
    // The timer knows a task by its id in the whole workload, of which its jitter depends.
    instance.timer = std::make_unique<runtime::ReleaseTimer>(
        [this, &instance](auto releases) { release(instance, releases); }, options_.seed);
    instance.engine->share_releases(instance.timer->thread());
    if (has_waits(part.workload)) {
      if (Result<void> ready = instance.engine->let_wait(); !ready) return ready;
    }
    std::size_t next = 0;
    for (const Dag &dag : part.workload.dags) {
      instance.timer->add(dag, std::span(part.tasks).subspan(next, dag.tasks.size()), 0);
      next += dag.tasks.size();
    }
    return {};
  }

  void release(Instance &instance, std::span<const runtime::Release> releases) {
    if (!instance.part.is_cluster()) return instance.engine->release(releases);
    instance.due.clear();
    for (const runtime::Release &release : releases) {
      instance.due.push_back({places_[release.task.value].task, release.nominal});
    }
    instance.engine->release(instance.due);
  }

  [[nodiscard]] Time time_now() const { return instances_.front()->engine->now(); }

  [[nodiscard]] runtime::Engine &engine_of(TaskId task) const {
    const auto owner = std::find_if(instances_.begin(), instances_.end(), [&](const auto &instance) {
      return &instance->part == &parts_[places_[task.value].part];
    });
    return *(*owner)->engine;
  }
  [[nodiscard]] TaskId local(TaskId task) const { return places_[task.value].task; }

  // Returns the sum of a figure over all engines.
  template <class Figure>
  [[nodiscard]] auto sum(Figure figure) const {
    auto total = figure(*instances_.front()->engine);
    for (std::size_t i = 1; i < instances_.size(); ++i) total += figure(*instances_[i]->engine);
    return total;
  }

  void warn_once(std::string warning) {
    const auto &known = result_.warnings;
    if (std::find(known.begin(), known.end(), warning) == known.end()) result_.warnings.push_back(std::move(warning));
  }

  void go_live() {
    std::vector<Duration> bounds;
    if (options_.bounds) bounds = options_.bounds(config());
    bounds.resize(workload_.task_count(), 0);
    auto publisher = live::Publisher::start(live_options(workload_.name, "threads", result_.mode, config()),
                                            [this, bounds = std::move(bounds)](live::Sample &sample) {
                                              for (const Dag &dag : workload_.dags)
                                                sample.dags.push_back({shown_name(dag), dag.max_active, dag.deadline});
                                              for (const TaskRef &ref : flatten(workload_)) {
                                                live::TaskSample task;
                                                fill(task, engine_of(ref.id).figures(local(ref.id)));
                                                task.key = ref.id.value;
                                                task.name = ref.task->name;
                                                task.dag = ref.dag.value;
                                                task.period = ref.task->period;
                                                task.deadline = ref.task->deadline;
                                                task.bound = bounds[ref.id.value];
                                                sample.tasks.push_back(std::move(task));
                                              }
                                              for (const auto &instance : instances_)
                                                add_threads(sample, *instance->engine, instance->part.tasks);
                                              // Clusters have none.
                                              add_devices(sample, *instances_.front()->engine);
                                            });
    if (publisher) {
      live_ = *std::move(publisher);
    } else {
      const Diagnostic &why = publisher.error().front();
      result_.warnings.push_back(fmt::format("{} ({})", why.message, why.hint));
    }
  }

  Result<void> start() {
    for (const auto &instance : instances_) {
      if (Result<void> started = instance->engine->start(); !started) return started;
    }
    origin_ = runtime::monotonic_now() + kStartMargin;
    result_.trace.info.origin = origin_;
    for (const auto &instance : instances_) {
      if (Result<void> started = start(*instance); !started) return started;
    }
    return {};
  }

  Result<void> start(Instance &instance) {
    instance.engine->set_origin(origin_);
    const bool realtime = options_.realtime_threads || result_.mode.mode == PreemptionMode::Os;
    const int priority = realtime ? instance.engine->options().band.timer : 0;
    if (options_.watchdog) {
      instance.watchdog = std::make_unique<runtime::Watchdog>(
          *instance.engine, *options_.watchdog,
          [this, &instance](const runtime::OverdueJob &job) { note(instance.part, job); });
      if (Result<void> started = instance.watchdog->start({"redag-watch", priority, {}}); !started) return started;
    }
    return instance.timer->start(origin_, options_.duration, {"redag-timer", priority, {}});
  }

  Result<void> record() {
    describe();
    if (options_.record.empty()) return {};
    const Result<std::string> aside = trace::move_unfinished_aside(options_.record);
    if (!aside) return tl::unexpected<Diagnostics>(aside.error());
    if (!aside->empty())
      result_.warnings.push_back(fmt::format("an earlier run did not end normally; its record is now '{}'", *aside));
    return trace::EventsWriter::record(options_.record, result_.trace.info, options_.record_bytes)
        .map([this](trace::EventsWriter &&file) { record_.emplace(std::move(file)); });
  }

  // Collects all events so far and records the new ones.
  void drain(bool finally) {
    auto &events = result_.trace.events;
    const std::size_t before = events.size();
    collect(events, finally);
    if (!record_) return;
    record_->add(std::span(events).subspan(before));
    const Result<void> kept = record_->flush(lost_events());
    if (kept) return;
    record_.reset();
    result_.warnings.push_back(
        fmt::format("if this process is killed, its trace is lost: {}", to_string(kept.error())));
  }

  // Appends the new events of all clusters, in order of time. Those of the last moments are kept back, because another
  // cluster can still report earlier ones.
  void collect(std::vector<JobEvent> &out, bool finally) {
    if (!parts_.front().is_cluster()) return instances_.front()->engine->drain(out, finally);
    const Time certain = finally ? kNever : time_now() - kKeptBack;
    for (const auto &instance : instances_) {
      const std::size_t before = kept_back_.size();
      instance->engine->drain(kept_back_, finally);
      for (JobEvent &event : std::span(kept_back_).subspan(before)) {
        event.task = instance->part.tasks[event.task.value];
        if (event.worker != WorkerId::kNoneValue) event.worker += instance->part.first_worker;
      }
    }
    std::stable_sort(kept_back_.begin(), kept_back_.end(),
                     [](const JobEvent &a, const JobEvent &b) { return a.time < b.time; });
    const auto end = std::find_if(kept_back_.begin(), kept_back_.end(),
                                  [certain](const JobEvent &event) { return event.time >= certain; });
    for (auto event = kept_back_.begin(); event != end; ++event) {
      latest_ = event->time = std::max(latest_, event->time);
      out.push_back(*event);
    }
    kept_back_.erase(kept_back_.begin(), end);
  }

  [[nodiscard]] std::uint64_t lost_events() const {
    return sum([](const runtime::Engine &engine) { return engine.lost_events(); });
  }

  // Passes the collected events to the sink, if there is one.
  void hand_over() {
    if (!options_.sink) return;
    options_.sink(result_.trace.info, result_.trace.events);
    result_.trace.events.clear();
  }

  void note(const ClusterPart &part, const runtime::OverdueJob &job) {
    std::string text = fmt::format("{} #{} is overdue: {}", trace::task_name(part.workload, job.job.task),
                                   job.job.number, runtime::describe(job));
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
      const bool idle = wait_idle(std::min(now + kCollectEvery, give_up));
      report_overdue();
      if (idle || now >= give_up) return idle;
    }
  }

  [[nodiscard]] bool wait_idle(Time until) {
    return std::all_of(instances_.begin(), instances_.end(),
                       [until](const auto &instance) { return instance->engine->wait_idle(until); });
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
      if (options_.progress) options_.progress(time_now(), result_.trace.events);
    }
  }

  void finish() {
    end_ = result_.stopped ? std::clamp<Time>(time_now(), 0, options_.duration) : options_.duration;
    // The timers report releases that were due until now. The trace ends where the first engine halts, which must be
    // after the last report.
    for (const auto &instance : instances_) instance->timer->stop();
    for (const auto &instance : instances_) instance->timer->join();
    for (const auto &instance : instances_) instance->engine->halt();
    if (!wait_idle()) {
      for (const auto &instance : instances_) {
        for (const runtime::Job &job : instance->engine->started()) {
          result_.unfinished.push_back(
              fmt::format("{} #{}", trace::task_name(instance->part.workload, job.task), job.number));
        }
      }
      give_up_.store(true);
    }
    (void)wait_idle(kNever);
    for (const auto &instance : instances_) {
      instance->watchdog.reset();
      instance->engine->join();
    }
    report_overdue();
    live_.reset();
    warn();
    cut();
    for (std::size_t t = 0; t < workload_.task_count(); ++t) {
      result_.usage.push_back(engine_of(TaskId(t)).figures(local(TaskId(t))).usage);
    }
  }

  // The configuration of all engines together.
  [[nodiscard]] sched::Config config() const {
    sched::Config config = instances_.front()->engine->options().config;
    if (parts_.front().is_cluster()) config.workers = workload_.platform.workers;
    return config;
  }

  void describe() {
    trace::RunInfo &info = result_.trace.info;
    info.workload = workload_;
    info.executor = options_.executor;
    info.config = config();
    info.preemption = to_string(result_.mode.mode);
    info.preemption_why = result_.mode.reason;
    info.driver = trace::Driver::Threads;
    info.seed = options_.seed;
    info.end = options_.duration;
    info.warm_up = options_.warm_up;
    trace::add_provenance(info);
  }

  void warn() {
    for (const auto &instance : instances_) {
      for (runtime::Problem &problem : instance->engine->problems())
        result_.warnings.push_back(std::move(problem.text));
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
    Time end = kNever;
    for (const auto &instance : instances_) end = std::min(end, instance->engine->halted_at());
    const auto after = std::find_if(events.begin(), events.end(), [&](const JobEvent &e) { return e.time >= end; });
    events.erase(after, events.end());
    hand_over();
    result_.trace.info.end = end_;
    result_.trace.info.lost_events = lost_events();
    if (result_.trace.info.lost_events > 0) {
      result_.warnings.push_back(
          fmt::format("{} events were lost: raise the trace capacity", result_.trace.info.lost_events));
    }
  }

  const Workload &workload_;
  const RunOptions &options_;
  std::vector<ClusterPart> parts_;
  std::vector<TaskPlace> places_;  // by TaskId
  RunResult result_;
  Mutex notes_lock_;
  std::vector<std::string> notes_ REDAG_GUARDED_BY(notes_lock_);  // from the watchdogs, not yet reported
  std::atomic<bool> give_up_{false};
  std::optional<trace::EventsWriter> record_;
  std::vector<runtime::Body> bodies_;                 // by TaskId, until the engines have them
  std::vector<std::unique_ptr<Instance>> instances_;  // at least one once prepared
  std::unique_ptr<live::Publisher> live_;             // after the engines, whose figures it reads until it is destroyed
  std::vector<JobEvent> kept_back_;                   // clusters: collected, but not yet in order
  Time latest_ = 0;                                   // of the events that are in order
  Time origin_ = 0;
  Time end_ = 0;
};

}  // namespace

Result<RunResult> run_workload(const Workload &workload, const RunOptions &options) {
  return Run(workload, options).execute();
}

}  // namespace redag::lab
