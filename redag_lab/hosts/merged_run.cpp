// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/hosts/merged_run.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <limits>
#include <optional>
#include <queue>
#include <utility>

#include "redag/base/int128.hpp"
#include "redag/base/provenance.hpp"
#include "redag/base/text.hpp"
#include "redag/model/validate.hpp"

namespace redag::hosts {
namespace {

std::string joined(const std::string &host, const std::string &name) { return host + "/" + name; }

Diagnostic mistake(std::string message, std::string hint = {}) {
  return Diagnostic{Severity::Error, {}, 0, 0, std::move(message), std::move(hint)};
}

// The workers of a run as its events number them. The threads of ROS 2 nodes can be more than the workers.
std::uint32_t workers_of(const trace::RunInfo &info) {
  return std::max(info.config.workers, info.workload.platform.workers);
}

// A setting that all runs of a trace share.
struct Setting {
  const char *what;
  std::string (*of)(const trace::RunInfo &);
};

constexpr Setting kCommonSettings[] = {
    {"executor", [](const trace::RunInfo &info) { return info.executor; }},
    {"driver", [](const trace::RunInfo &info) { return std::string(trace::to_string(info.driver)); }},
    {"preemption", [](const trace::RunInfo &info) { return info.preemption; }},
    {"policy", [](const trace::RunInfo &info) { return std::string(to_string(info.config.policy)); }},
    {"ties", [](const trace::RunInfo &info) { return std::string(to_string(info.config.ties)); }},
    {"number of levels", [](const trace::RunInfo &info) { return std::to_string(info.config.levels); }},
};

// Texts of hosts in one: the text itself if all have the same, or else each after its host's name.
template <class Text>
std::string of_hosts(const std::vector<Host> &hosts, Text text) {
  const bool is_same =
      std::all_of(hosts.begin(), hosts.end(), [&](const Host &host) { return text(host) == text(hosts.front()); });
  if (is_same) return text(hosts.front());
  std::string all;
  for (const Host &host : hosts) {
    if (text(host).empty()) continue;
    all += (all.empty() ? "" : "; ") + host.name + ": " + text(host);
  }
  return all;
}

class Merging {
 public:
  explicit Merging(const std::vector<HostRun> &runs) : runs_(runs) {}

  Result<MergedRun> run() {
    check_settings();
    check_clocks();
    for (const HostRun &run : runs_) {
      check_drawn(run);
      add_host(run);
    }
    if (!mistakes_.empty()) return tl::unexpected<Diagnostics>(std::move(mistakes_));
    shift();
    if (!mistakes_.empty()) return tl::unexpected<Diagnostics>(std::move(mistakes_));
    describe();
    for (Host &host : merged_.hosts) add_workload(host);
    const Diagnostics found = validate(merged_.info.workload, {.wcet_optional = true, .waits = true});
    for (const Diagnostic &each : found) {
      if (each.severity == Severity::Error) mistakes_.push_back(each);
    }
    if (!mistakes_.empty()) return tl::unexpected<Diagnostics>(std::move(mistakes_));
    return std::move(merged_);
  }

 private:
  void check_settings() {
    const HostRun &first = runs_.front();
    for (const HostRun &run : runs_) {
      for (const Setting &setting : kCommonSettings) {
        const std::string a = setting.of(first.reader.info());
        const std::string b = setting.of(run.reader.info());
        if (a == b) continue;
        mistakes_.push_back(mistake(fmt::format("{}: the {} is {}, and that of host '{}' is {}", run.path, setting.what,
                                                in_quotes(b), first.name, in_quotes(a)),
                                    "one trace has one kind of run: record all hosts with the same settings"));
      }
    }
  }

  // What a simulated job draws depends on the position of its task, which is another one in the merged run.
  void check_drawn(const HostRun &run) {
    const trace::RunInfo &info = run.reader.info();
    if (info.driver != trace::Driver::Simulator) return;
    for (const Dag &dag : info.workload.dags) {
      for (const Task &task : dag.tasks) {
        if (task.execution.kind == ExecutionTime::Kind::Constant) continue;
        mistakes_.push_back(mistake(fmt::format("{}: the simulator has drawn execution times of task '{}.{}', which "
                                                "the trace checker cannot draw again in a merged run",
                                                run.path, dag.name, task.name),
                                    "simulate hosts with constant execution times"));
        return;
      }
    }
  }

  void check_clocks() {
    const auto states = [](const HostRun &run) { return run.reader.info().clock.has_value(); };
    if (std::all_of(runs_.begin(), runs_.end(), states) || std::none_of(runs_.begin(), runs_.end(), states)) return;
    for (const HostRun &run : runs_) {
      if (states(run)) continue;
      mistakes_.push_back(
          mistake(fmt::format("{}: it does not state the time of the system's clock, and others do", run.path),
                  "record it again with this version of redag"));
    }
  }

  void add_host(const HostRun &run) {
    const trace::RunInfo &info = run.reader.info();
    Result<ClockOffset> clock =
        ClockOffset::of(run.clock, info.start, info.end, info.clock ? info.clock->error : Duration{0});
    if (!clock) {
      for (Diagnostic each : clock.error()) {
        each.message = fmt::format("host '{}': {}", run.name, each.message);
        each.file = run.file;
        each.line = run.line;
        each.column = run.column;
        mistakes_.push_back(std::move(each));
      }
      return;
    }
    merged_.hosts.push_back(Host{run.name, run.path, info, run.clock.by, *std::move(clock)});
  }

  // The first host keeps its times.
  void shift() {
    const auto zero = [](const Host &host) {
      const Duration to_system = host.info.clock ? host.info.clock->system - host.info.clock->at : 0;
      return Int128{to_system} - host.clock.shift();
    };
    const Int128 first = zero(merged_.hosts.front());
    trace::RunInfo &run = merged_.info;
    run.start = kNever;
    run.end = kNever;
    Time last_start = std::numeric_limits<Time>::min();
    for (Host &host : merged_.hosts) {
      const Int128 shift = zero(host) - first;
      if (shift + host.info.start < -trace::kMaxTraceTime || shift + host.info.end > trace::kMaxTraceTime) {
        mistakes_.push_back(
            mistake(fmt::format("host '{}' was recorded decades before or after the first one", host.name),
                    "set the clocks of the hosts before you record them"));
        return;
      }
      host.shift = static_cast<Duration>(shift);
      run.start = std::min(run.start, host.info.start + host.shift);
      run.end = std::min(run.end, host.info.end + host.shift);
      last_start = std::max(last_start, host.info.start + host.shift);
      warm_up_end_ = std::max(warm_up_end_, host.info.start + host.info.warm_up + host.shift);
    }
    if (last_start < run.end) return;
    for (const Host &host : merged_.hosts) {
      mistakes_.push_back(mistake(fmt::format("host '{}' was recorded from {} to {} of the first host's time, and the "
                                              "hosts have no time in common",
                                              host.name, format_duration(host.info.start + host.shift),
                                              format_duration(host.info.end + host.shift)),
                                  "name results of one run of the robot, and check the offsets"));
    }
  }

  void describe() {
    const std::vector<Host> &hosts = merged_.hosts;
    trace::RunInfo &run = merged_.info;
    const trace::RunInfo &first = hosts.front().info;
    run.executor = first.executor;
    run.config = first.config;
    run.config.workers = 0;
    run.preemption = first.preemption;
    run.preemption_why = of_hosts(hosts, [](const Host &host) { return host.info.preemption_why; });
    run.driver = first.driver;
    run.seed = first.seed;
    run.warm_up = std::min(warm_up_end_, run.end) - run.start;
    run.overheads = of_hosts(hosts, [](const Host &host) { return host.info.overheads; });
    run.machine.kernel = of_hosts(hosts, [](const Host &host) { return host.info.machine.kernel; });
    run.machine.model = of_hosts(hosts, [](const Host &host) { return host.info.machine.model; });
    run.clock = first.clock;
    run.provenance = current_provenance();
    run.workload.name = fmt::format("{}", fmt::join(names(), "+"));
    if (!name_mistake(run.workload.name).empty()) run.workload.name = fmt::format("{} hosts", hosts.size());
    run.workload.platform = first.workload.platform;
    run.workload.platform.workers = 0;
    run.workload.platform.clusters.clear();
    run.workload.platform.devices.clear();
    run.workload.policy = first.workload.policy;
    run.workload.ties = first.workload.ties;
  }

  [[nodiscard]] std::vector<std::string_view> names() const {
    std::vector<std::string_view> names;
    for (const Host &host : merged_.hosts) names.emplace_back(host.name);
    return names;
  }

  void add_workload(Host &host) {
    trace::RunInfo &run = merged_.info;
    const trace::RunInfo &own = host.info;
    Platform &platform = run.workload.platform;
    host.first_worker = platform.workers;
    host.first_task = static_cast<std::uint32_t>(merged_.host_of_task.size());
    host.first_dag = static_cast<std::uint32_t>(run.workload.dags.size());
    host.first_device = static_cast<std::uint32_t>(platform.devices.size());
    run.stepped = run.stepped || own.stepped;
    run.lost_events += own.lost_events;
    run.machine.cpus += own.machine.cpus;
    run.config.max_started = std::max(run.config.max_started, own.config.max_started);
    // Processors of several hosts have the same numbers, and only a run needs them.
    for (const Cluster &cluster : own.workload.platform.clusters) {
      platform.clusters.push_back({joined(host.name, cluster.name), cluster.workers});
    }
    if (own.workload.platform.clusters.empty()) platform.clusters.push_back({host.name, workers_of(own)});
    platform.workers += workers_of(own);
    run.config.workers = platform.workers;
    for (Device device : own.workload.platform.devices) {
      device.name = joined(host.name, device.name);
      platform.devices.push_back(std::move(device));
    }
    // The grid of all timers begins with the merged run.
    const Duration later = own.start + host.shift - run.start;
    for (Dag dag : own.workload.dags) {
      dag.cluster = dag.cluster.empty() ? platform.clusters.back().name : joined(host.name, dag.cluster);
      dag.name = joined(host.name, dag.name);
      for (Task &task : dag.tasks) {
        if (!task.group.empty()) task.group = joined(host.name, task.group);
        if (task.activation == Activation::Timer) task.offset += later;
        for (Wait &wait : task.waits) {
          if (wait.device.valid()) wait.device.value += host.first_device;
        }
      }
      merged_.host_of_task.insert(merged_.host_of_task.end(), dag.tasks.size(),
                                  static_cast<std::uint32_t>(&host - merged_.hosts.data()));
      run.workload.dags.push_back(std::move(dag));
    }
    for (const TaskId task : own.event_tasks) run.event_tasks.emplace_back(task.value + host.first_task);
    for (const trace::Remark &remark : own.remarks) {
      run.remarks.push_back({.begun = remark.begun + host.shift,
                             .ended = remark.ended == kNever ? kNever : remark.ended + host.shift,
                             .text = host.name + ": " + remark.text});
    }
  }

  const std::vector<HostRun> &runs_;
  Diagnostics mistakes_;
  MergedRun merged_;
  Time warm_up_end_ = std::numeric_limits<Time>::min();
};

// The events of one host, in merged time.
class Stream {
 public:
  Stream(const Host &host, HostRun &run) : host_(host), run_(run) {}

  /// The next event; null after the last one, or after an error.
  [[nodiscard]] const JobEvent *peek() const { return next_ < events_.size() ? &events_[next_] : nullptr; }

  Result<void> advance() {
    if (++next_ < events_.size()) return {};
    return load();
  }

  Result<void> load() {
    next_ = 0;
    const Result<bool> more = run_.reader.next(events_);
    if (!more) return tl::unexpected<Diagnostics>(more.error());
    if (!*more) events_.clear();
    for (JobEvent &event : events_) {
      if (event.worker != WorkerId::kNoneValue && event.worker >= workers_of(host_.info)) {
        return make_error(
            fmt::format("{}: an event names worker {} of {}", run_.path, event.worker, workers_of(host_.info)));
      }
      event = host_.merged(event);
      if (trace::has_valid_times(event)) continue;
      return make_error(fmt::format("{}: the times of an event are decades from those of the run", run_.path));
    }
    return {};
  }

 private:
  const Host &host_;
  HostRun &run_;
  std::vector<JobEvent> events_;
  std::size_t next_ = 0;
};

Time add_wrapping(Time time, Duration by) {
  return static_cast<Time>(static_cast<std::uint64_t>(time) + static_cast<std::uint64_t>(by));
}

}  // namespace

Interval Host::correction(Time merged) const {
  const Interval offset = clock.at(merged - shift);
  return {clock.shift() - offset.high - clock.error(), clock.shift() - offset.low + clock.error()};
}

Interval time_between(const Host &from, Time begin, const Host &to, Time end) {
  if (&from == &to) {
    const Interval change = from.clock.change(begin - from.shift, end - from.shift);
    return {end - begin - change.high, end - begin - change.low};
  }
  const Interval first = from.correction(begin);
  const Interval last = to.correction(end);
  return {end - begin + last.low - first.high, end - begin + last.high - first.low};
}

// A damaged file can hold any value. Sums wrap, and the caller checks the event.
JobEvent Host::merged(JobEvent event) const {
  event.time = add_wrapping(event.time, shift);
  event.task.value += first_task;
  if (event.worker != WorkerId::kNoneValue) event.worker += first_worker;
  switch (event.kind) {
    case JobEventKind::Released:
    case JobEventKind::Ready:
    case JobEventKind::Dispatched:
    case JobEventKind::Started:
    case JobEventKind::Finished:
    case JobEventKind::Aborted:
    case JobEventKind::LowMode: event.value = add_wrapping(event.value, shift); break;
    case JobEventKind::Waits:
    case JobEventKind::Served:
    case JobEventKind::Woken:
      if (event.value >= 0) event.value = add_wrapping(event.value, first_device);
      break;
    default: break;
  }
  return event;
}

Result<MergedRun> merge(const std::vector<HostRun> &runs) { return Merging(runs).run(); }

Result<void> visit_merged(const MergedRun &merged, std::vector<HostRun> &runs, const std::function<bool()> &is_stopped,
                          const std::function<void(std::span<const JobEvent>)> &visit) {
  constexpr std::size_t kBatch = 4096;
  std::vector<Stream> streams;
  for (std::size_t h = 0; h < runs.size(); ++h) {
    streams.emplace_back(merged.hosts[h], runs[h]);
    if (Result<void> loaded = streams.back().load(); !loaded) return loaded;
  }
  // The earliest event first; of one instant, the first host's.
  using Head = std::pair<Time, std::size_t>;
  std::priority_queue<Head, std::vector<Head>, std::greater<>> heads;
  const auto push = [&](std::size_t h) {
    if (const JobEvent *event = streams[h].peek(); event != nullptr) heads.emplace(event->time, h);
  };
  for (std::size_t h = 0; h < streams.size(); ++h) push(h);
  std::vector<JobEvent> batch;
  while (!heads.empty() && heads.top().first < merged.info.end) {
    const std::size_t h = heads.top().second;
    heads.pop();
    batch.push_back(*streams[h].peek());
    if (Result<void> advanced = streams[h].advance(); !advanced) return advanced;
    push(h);
    if (batch.size() < kBatch) continue;
    if (is_stopped()) return make_error("interrupted: the runs were not merged");
    visit(batch);
    batch.clear();
  }
  if (!batch.empty()) visit(batch);
  return {};
}

}  // namespace redag::hosts
