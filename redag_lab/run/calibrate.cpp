// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/run/calibrate.hpp"

#include <sys/syscall.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <fstream>
#include <map>
#include <optional>
#include <unordered_map>
#include <utility>

#include <fmt/format.h>

#include "redag/base/check.hpp"
#include "redag/base/rounded_time.hpp"
#include "redag/engine/preemption_point.hpp"
#include "redag/threads/clock.hpp"
#include "redag/threads/setup.hpp"
#include "redag/threads/threads.hpp"
#include "redag/trace/trace.hpp"
#include "redag_lab/run/machine_load.hpp"
#include "redag_lab/run/run_workload.hpp"
#include "redag_lab/run/stall_probe.hpp"

namespace redag::lab {
namespace {

constexpr Duration kShortestSlice = 250 * kMillisecond;
constexpr Duration kLongestSlice = 2 * kSecond;
constexpr Duration kRegion = 200 * kMicrosecond;
constexpr const char *kLong = "long";

// ---- findings of one class of threads ----

std::vector<Duration> lengths_of(std::span<const LossSample> samples) {
  std::vector<Duration> lengths;
  lengths.reserve(samples.size());
  for (const LossSample &sample : samples) lengths.push_back(sample.length);
  return lengths;
}

void append(std::vector<LossSample> &to, std::span<const LossSample> from, Duration later) {
  for (const LossSample &sample : from) to.push_back({sample.at + later, sample.length});
}

void take_larger(Loss &loss, const Loss &other) {
  loss.longest = std::max(loss.longest, other.longest);
  loss.per_second = std::max(loss.per_second, other.per_second);
}

struct Findings {
  std::vector<LossSample> dispatch;
  std::vector<LossSample> preempt;
  Duration ran = 0;                                      // wall-clock time of the runs with jobs
  std::map<std::string, std::vector<Duration>> samples;  // by the quantity's name
  std::vector<WatchedProcessor> processors;

  void add(const std::string &name, std::vector<Duration> more) {
    std::vector<Duration> &all = samples[name];
    all.insert(all.end(), more.begin(), more.end());
  }

  void add(const TraceFigures &figures, Duration length) {
    add("lateness", figures.lateness);
    append(dispatch, figures.dispatch, ran);
    append(preempt, figures.preempt, ran);
    ran += length;
  }

  void add(std::vector<WatchedProcessor> more) {
    processors.resize(std::max(processors.size(), more.size()));
    for (std::size_t i = 0; i < more.size(); ++i) {
      WatchedProcessor &processor = processors[i];
      for (Gap gap : more[i].gaps) {
        gap.at += processor.watched;
        processor.gaps.push_back(gap);
      }
      processor.watched += more[i].watched;
      processor.cpu = more[i].cpu;
    }
  }

  [[nodiscard]] Duration longest(const std::string &name) const {
    const auto found = samples.find(name);
    return found == samples.end() ? 0 : *std::max_element(found->second.begin(), found->second.end());
  }

  [[nodiscard]] bool is_complete() const {
    const auto has = [this](const char *name) {
      const auto found = samples.find(name);
      return found != samples.end() && !found->second.empty();
    };
    return has("lateness") && has("timer") && !dispatch.empty() && !preempt.empty() &&
           std::any_of(processors.begin(), processors.end(), [](const WatchedProcessor &p) { return p.watched > 0; });
  }

  [[nodiscard]] Loss loss(Duration Gap::*part) const {
    Loss worst;
    for (const WatchedProcessor &processor : processors) {
      std::vector<LossSample> lost;
      for (const Gap &gap : processor.gaps) {
        if (gap.*part > 0) lost.push_back({gap.at, gap.*part});
      }
      const Loss fitted = fit_loss(lost, processor.watched);
      take_larger(worst, fitted);
    }
    return worst;
  }

  void include(const Findings &other) {
    for (const auto &[name, values] : other.samples) add(name, values);
    append(dispatch, other.dispatch, ran);
    append(preempt, other.preempt, ran);
    ran += other.ran;
    add(other.processors);
  }
};

Measured measured(std::string what, const char *threads, const char *load, std::vector<Duration> values) {
  std::sort(values.begin(), values.end());
  const auto at = [&](double share) {
    return values[std::min(values.size() - 1, static_cast<std::size_t>(share * static_cast<double>(values.size())))];
  };
  return {std::move(what), threads, load, values.size(), at(0.5), at(0.99), at(0.999), values.back()};
}

// ---- processor time of the release timer, whose thread is this process's own ----

// Returns the processor-time clock of the thread of that name; nothing if there is no such thread.
std::optional<clockid_t> clock_of_thread(const std::string &name) {
  std::error_code ignored;
  for (const auto &entry : std::filesystem::directory_iterator("/proc/self/task", ignored)) {
    std::ifstream stream(entry.path() / "comm");
    std::string comm;
    if (!std::getline(stream, comm) || comm != name) continue;
    const auto tid = static_cast<unsigned>(std::stoul(entry.path().filename().string()));
    constexpr unsigned kPerThread = 4;  // bits of a clock id, as in the kernel's include/linux/posix-timers.h
    constexpr unsigned kSchedClock = 2;
    return static_cast<clockid_t>((~tid << 3U) | kPerThread | kSchedClock);
  }
  return std::nullopt;
}

class TimerWatch {
 public:
  explicit TimerWatch(const Workload &workload) {
    for (const TaskRef &ref : flatten(workload)) is_timer_.push_back(ref.task->activation == Activation::Timer);
  }

  void look(std::span<const JobEvent> events) {
    if (!clock_) clock_ = clock_of_thread("redag-timer");
    if (!clock_) return;
    for (; seen_ < events.size(); ++seen_) {
      const JobEvent &event = events[seen_];
      if (event.kind == JobEventKind::Released && is_timer_[event.task.value]) ++releases_;
    }
    const Duration used = runtime::cpu_now(*clock_);
    constexpr std::uint64_t kEnough = 20;  // releases, for a meaningful mean
    if (last_used_ && releases_ >= kEnough) {
      each_.push_back((used - *last_used_) / static_cast<Duration>(releases_));
      releases_ = 0;
      last_used_ = used;
    } else if (!last_used_) {
      releases_ = 0;
      last_used_ = used;
    }
  }

  std::vector<Duration> take() { return std::move(each_); }

 private:
  std::vector<bool> is_timer_;
  std::optional<clockid_t> clock_;
  std::size_t seen_ = 0;
  std::uint64_t releases_ = 0;
  std::optional<Duration> last_used_;
  std::vector<Duration> each_;
};

// ---- bodies that record when they did not run ----

class Noted {
 public:
  explicit Noted(std::size_t tasks) : absences_(tasks) {}

  runtime::Body body(const Task &task, TaskId id, const Now &now) {
    std::vector<Absence> &absences = absences_[id.value];
    constexpr std::size_t kMost = std::size_t{1} << 15U;
    absences.reserve(kMost);
    return [&absences, now, demand = task.wcet](const runtime::Job & /*job*/) {
      Time last = now();
      Duration next_point = kRegion;
      for (Duration used = job_cpu_time(); used < demand; used = job_cpu_time()) {
        if (used >= next_point) {
          preemption_point();
          next_point = used + kRegion;
        }
        const Time until = now() + std::min(next_point, demand) - used;
        for (Time at = now(); at < until; at = now()) {
          if (at - last >= kShortestGap && absences.size() < kMost) absences.push_back({last, at});
          last = at;
        }
      }
      return sched::Outcome::Finished;
    };
  }

  [[nodiscard]] const std::vector<std::vector<Absence>> &all() const { return absences_; }

 private:
  std::vector<std::vector<Absence>> absences_;
};

Duration clock_cost(std::vector<Duration> &thread_clock, std::vector<Duration> &steady_clock) {
  constexpr int kReadings = 20'000;
  Duration before = runtime::thread_cpu_now();
  for (int i = 0; i < kReadings; ++i) {
    const Duration now = runtime::thread_cpu_now();
    thread_clock.push_back(now - before);
    before = now;
  }
  Time earlier = runtime::monotonic_now();
  for (int i = 0; i < kReadings; ++i) {
    const Time now = runtime::monotonic_now();
    steady_clock.push_back(now - earlier);
    earlier = now;
  }
  std::sort(thread_clock.begin(), thread_clock.end());
  return thread_clock[thread_clock.size() * 999 / 1000];
}

class Calibrating {
 public:
  explicit Calibrating(const CalibrateOptions &options) : options_(options), band_(runtime::probe_priority_band()) {}

  Result<Calibration> run() {
    const std::size_t cpus = runtime::usable_cpus().size();
    workload_ = calibration_workload(static_cast<std::uint32_t>(cpus));
    std::vector<Duration> thread_clock;
    std::vector<Duration> steady_clock;
    clock_ = clock_cost(thread_clock, steady_clock);
    result_.measured.push_back(measured("thread_clock", "any", "idle", std::move(thread_clock)));
    result_.measured.push_back(measured("steady_clock", "any", "idle", std::move(steady_clock)));
    const Time begun = runtime::monotonic_now();
    if (Result<void> done = measure(cpus); !done) return tl::unexpected(done.error());
    result_.duration = runtime::monotonic_now() - begun;
    return conclude(cpus);
  }

 private:
  struct Slice {
    bool realtime = false;
    bool loaded = false;
    bool stalls = false;
  };

  [[nodiscard]] bool stopped() const { return options_.stop != nullptr && options_.stop->load(); }

  // Measures all slices in turn, several times over. A calibration that is stopped early then has results of each
  // slice.
  Result<void> measure(std::size_t cpus) {
    std::vector<Slice> slices;
    for (const bool loaded : {false, true}) {
      if (loaded && !options_.loaded) continue;
      for (const bool realtime : {true, false}) {
        if (realtime && band_.top_job == 0) continue;
        slices.push_back({realtime, loaded, false});
        slices.push_back({realtime, loaded, true});
      }
    }
    const auto count = static_cast<Duration>(slices.size());
    constexpr Duration kRounds = 4;
    const Duration rounds = std::clamp<Duration>(options_.duration / (count * kShortestSlice), 1, kRounds);
    const Duration each = options_.duration / (count * rounds);
    const Duration turns = std::max<Duration>(1, (each + kLongestSlice - 1) / kLongestSlice) * rounds;
    const Duration length = std::max<Duration>(options_.duration / (count * turns), 10 * kMillisecond);
    for (Duration turn = 0; turn < turns; ++turn) {
      for (std::size_t s = 0; s < slices.size(); ++s) {
        if (stopped()) {
          result_.complete = false;
          return {};
        }
        const Slice &slice = slices[s];
        if (options_.progress) {
          const double done =
              static_cast<double>(turn * count + static_cast<Duration>(s)) / static_cast<double>(turns * count);
          options_.progress(done, slice.stalls ? "stalls" : "dispatch, preemption, timer");
        }
        MachineLoad load;
        if (slice.loaded) {
          if (Result<void> started = load.start(cpus); !started) return started;
        }
        // The first turn is short: a calibration that is stopped early soon has a result of each slice.
        const Duration now = turn == 0 ? std::min(length, kShortestSlice) : length;
        Result<void> done = slice.stalls ? watch_stalls(slice, now) : run_jobs(slice, now);
        if (!done) return done;
      }
    }
    result_.complete = result_.complete && !stopped();
    return {};
  }

  Findings &findings(const Slice &slice) { return findings_[slice.realtime ? 1 : 0][slice.loaded ? 1 : 0]; }

  Result<void> watch_stalls(const Slice &slice, Duration length) {
    // The probe has the lowest priority of all jobs. Anything above it can also take a processor from a job.
    return watch_for_stalls({length, slice.realtime ? 1 : 0, options_.stop})
        .map([&](std::vector<WatchedProcessor> watched) { findings(slice).add(std::move(watched)); });
  }

  Result<void> run_jobs(const Slice &slice, Duration length) {
    Noted noted(workload_.task_count());
    TimerWatch timer(workload_);
    RunOptions run;
    run.duration = length;
    run.preemption = slice.realtime ? PreemptionMode::Os : PreemptionMode::Cooperative;
    run.stop = options_.stop;
    run.seed = ++seed_;
    run.bodies = [&](std::vector<runtime::Body> bodies, const Now &now) {
      for (const TaskRef &ref : flatten(workload_)) {
        if (ref.task->name == kLong) bodies[ref.id.value] = noted.body(*ref.task, ref.id, now);
      }
      return bodies;
    };
    run.progress = [&](Time, std::span<const JobEvent> events) { timer.look(events); };
    return run_workload(workload_, run).map([&](const RunResult &result) {
      Findings &found = findings(slice);
      found.add(figures_of(workload_, result.trace.events, noted.all()), result.trace.info.end);
      found.add("timer", timer.take());
    });
  }

  Result<Calibration> conclude(std::size_t cpus) {
    for (const bool realtime : {true, false}) {
      Findings all;
      for (const bool loaded : {false, true}) {
        const Findings &found = findings_[realtime ? 1 : 0][loaded ? 1 : 0];
        note(found, realtime ? "realtime" : "normal", loaded ? "loaded" : "idle");
        all.include(found);
      }
      if (!all.is_complete()) continue;
      Overheads charged;
      charged.timer = all.longest("timer");
      charged.lateness = all.longest("lateness");
      charged.stall = all.loss(&Gap::length);
      charged.noise = all.loss(&Gap::charged);
      charged.clock = clock_;
      Loss beyond;
      charged.dispatch = usual_delay(all.dispatch, all.ran, beyond);
      take_larger(charged.stall, beyond);
      charged.preempt = usual_delay(all.preempt, all.ran, beyond);
      take_larger(charged.stall, beyond);
      // Rounds up, because people read these numbers and no measurement is accurate to the nanosecond.
      for (const std::string_view name : overhead_names()) {
        Duration &value = *overhead_named(charged, name);
        value = round_up(value);
      }
      (realtime ? result_.realtime : result_.normal) = charged;
    }
    if (!result_.realtime && !result_.normal) {
      return make_error("the calibration ended before everything was measured once: there is nothing to write",
                        "on most machines, a second is long enough");
    }
    result_.processors = static_cast<std::uint32_t>(cpus);
    result_.processor = trace::this_machine().model;
    result_.rights = band_.top_job > 0 ? fmt::format("SCHED_FIFO up to {}", band_.timer) : "no SCHED_FIFO";
    result_.load = options_.loaded ? "idle and loaded" : "idle";
    return std::move(result_);
  }

  void note(const Findings &found, const char *threads, const char *load) {
    for (const auto &[name, values] : found.samples) {
      if (!values.empty()) result_.measured.push_back(measured(name, threads, load, values));
    }
    if (!found.dispatch.empty()) {
      result_.measured.push_back(measured("dispatch", threads, load, lengths_of(found.dispatch)));
    }
    if (!found.preempt.empty()) {
      result_.measured.push_back(measured("preempt", threads, load, lengths_of(found.preempt)));
    }
    for (const auto &[name, part] : {std::pair("stall", &Gap::length), std::pair("noise", &Gap::charged)}) {
      std::vector<Duration> lengths;
      for (const WatchedProcessor &processor : found.processors) {
        for (const Gap &gap : processor.gaps) {
          if (gap.*part > 0) lengths.push_back(gap.*part);
        }
      }
      if (!lengths.empty()) result_.measured.push_back(measured(name, threads, load, std::move(lengths)));
    }
  }

  const CalibrateOptions &options_;
  runtime::PriorityBand band_;
  Workload workload_;
  Duration clock_ = 0;
  std::uint64_t seed_ = 0;
  std::array<std::array<Findings, 2>, 2> findings_;  // [realtime][loaded]
  Calibration result_;
};

}  // namespace

Workload calibration_workload(std::uint32_t workers) {
  Workload workload;
  workload.name = "calibration";
  workload.platform.workers = workers;
  const auto timer = [](const char *name, Duration period, Duration wcet) {
    Task task;
    task.name = name;
    task.period = task.deadline = period;
    task.wcet = task.bcet = wcet;
    return task;
  };
  Dag pulse;
  pulse.name = "pulse";
  pulse.tasks = {timer("tick", kMillisecond, 20 * kMicrosecond), timer("tock", kMillisecond, 20 * kMicrosecond)};
  pulse.tasks[1].activation = Activation::Data;
  pulse.tasks[1].predecessors = {0};
  workload.dags.push_back(std::move(pulse));
  Dag beat;
  beat.name = "beat";
  beat.tasks = {timer("beat", 7 * kMillisecond, 300 * kMicrosecond)};
  workload.dags.push_back(std::move(beat));
  for (std::uint32_t w = 0; w < workers; ++w) {
    Dag dag;
    dag.name = fmt::format("worker{}", w);
    dag.tasks = {timer(kLong, 50 * kMillisecond, 20 * kMillisecond)};
    dag.tasks[0].region = kRegion;
    workload.dags.push_back(std::move(dag));
  }
  return workload;
}

TraceFigures figures_of(const Workload &workload, std::span<const JobEvent> events,
                        const std::vector<std::vector<Absence>> &absences) {
  TraceFigures figures;
  const std::vector<TaskRef> refs = flatten(workload);
  std::vector<std::size_t> next(refs.size());                // index into the task's absences; earlier ones have passed
  std::vector<std::optional<Time>> dispatched(refs.size());  // the tasks have `concurrency` 1: one job each
  for (const JobEvent &event : events) {
    const std::size_t t = event.task.value;
    REDAG_CHECK(t < refs.size(), "an event of another workload");
    switch (event.kind) {
      case JobEventKind::Released:
        if (refs[t].task->activation == Activation::Timer) figures.lateness.push_back(event.time - event.value);
        break;
      case JobEventKind::Dispatched: dispatched[t] = event.time; break;
      case JobEventKind::Started:
        if (dispatched[t]) {
          figures.dispatch.push_back({*dispatched[t], std::max<Duration>(0, event.value - *dispatched[t])});
        }
        dispatched[t].reset();
        break;
      case JobEventKind::Resumed: {
        const std::vector<Absence> &own = absences[t];
        while (next[t] < own.size() && own[next[t]].end < event.time) ++next[t];
        if (next[t] == own.size() || own[next[t]].begin > event.time) break;  // the job had not stopped
        figures.preempt.push_back({event.time, own[next[t]].end - event.time});
        break;
      }
      default: break;
    }
  }
  const auto earlier = [](const LossSample &x, const LossSample &y) { return x.at < y.at; };
  std::sort(figures.dispatch.begin(), figures.dispatch.end(), earlier);
  return figures;
}

Duration usual_delay(std::span<const LossSample> delays, Duration watched, Loss &beyond) {
  REDAG_CHECK(!delays.empty(), "the usual one of no delays");
  std::vector<Duration> lengths = lengths_of(delays);
  std::sort(lengths.begin(), lengths.end());
  const Duration usual = lengths[std::min(lengths.size() - 1, lengths.size() * 99 / 100)];
  std::vector<LossSample> excess;
  for (const LossSample &delay : delays) {
    if (delay.length > usual) excess.push_back({delay.at + delay.length, delay.length - usual});
  }
  beyond = fit_loss(excess, watched);
  return usual;
}

Result<Calibration> calibrate(const CalibrateOptions &options) { return Calibrating(options).run(); }

}  // namespace redag::lab
