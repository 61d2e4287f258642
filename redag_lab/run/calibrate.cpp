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
#include <memory>
#include <optional>
#include <utility>

#include <fmt/format.h>

#include "redag/base/check.hpp"
#include "redag/base/int128.hpp"
#include "redag/engine/preemption_point.hpp"
#include "redag/threads/clock.hpp"
#include "redag/threads/parker.hpp"
#include "redag/threads/setup.hpp"
#include "redag/threads/threads.hpp"
#include "redag/trace/trace.hpp"
#include "redag_analysis/text/rounded_time.hpp"
#include "redag_lab/run/run_workload.hpp"

namespace redag::lab {
namespace {

constexpr Duration kShortestSlice = 250 * kMillisecond;
constexpr Duration kLongestSlice = 2 * kSecond;
constexpr Duration kRegion = 200 * kMicrosecond;
constexpr Duration kShortestGap = 2 * kMicrosecond;  // shorter ones are caused by the loop itself
constexpr const char *kLong = "long";
constexpr Duration kBurst = 40 * kMillisecond;  // a watching SCHED_FIFO thread pauses, lest the kernel throttle it
constexpr Duration kPause = 10 * kMillisecond;
constexpr std::size_t kMostGaps = std::size_t{1} << 17U;

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

// An interval in which a thread that reads the clock without end did not run.
struct Gap {
  Duration at = 0;       // its end, in watched time
  Duration length = 0;   // wall-clock time
  Duration charged = 0;  // processor time charged to the thread: the kernel's work in its name
};

struct WatchedProcessor {
  Duration watched = 0;
  std::vector<Gap> gaps;
};

// What was found of one class of threads.
struct Findings {
  std::vector<LossSample> dispatch;
  std::vector<LossSample> preempt;
  Duration ran = 0;  // wall-clock time of the runs with jobs
  std::vector<Duration> lateness;
  std::vector<Duration> timer;
  std::map<int, WatchedProcessor> processors;

  void add(const TraceFigures &figures, Duration length) {
    lateness.insert(lateness.end(), figures.lateness.begin(), figures.lateness.end());
    append(dispatch, figures.dispatch, ran);
    append(preempt, figures.preempt, ran);
    ran += length;
  }

  [[nodiscard]] bool is_complete() const {
    return !lateness.empty() && !timer.empty() && !dispatch.empty() && !preempt.empty() &&
           std::any_of(processors.begin(), processors.end(), [](const auto &each) { return each.second.watched > 0; });
  }

  // Returns the losses of each processor, with the time for which it was watched.
  [[nodiscard]] std::vector<std::pair<std::vector<LossSample>, Duration>> losses(Duration Gap::*part) const {
    std::vector<std::pair<std::vector<LossSample>, Duration>> all;
    for (const auto &[cpu, processor] : processors) {
      std::vector<LossSample> lost;
      for (const Gap &gap : processor.gaps) {
        if (gap.*part > 0) lost.push_back({gap.at, gap.*part});
      }
      all.emplace_back(std::move(lost), processor.watched);
    }
    return all;
  }

  [[nodiscard]] Loss loss(Duration Gap::*part) const {
    Loss worst;
    for (const auto &[lost, watched] : losses(part)) take_larger(worst, fit_loss(lost, watched));
    return worst;
  }
};

// A thread that reads the clock without end on one processor and records the gaps, as Linux's osnoise tracer does.
class Watcher {
 public:
  Watcher(Duration length, const std::atomic<bool> *stop) : length_(length), stop_(stop), gaps_(kMostGaps) {}

  Result<void> start(int cpu, int fifo_priority) {
    return runtime::start_thread({"redag-stalls", fifo_priority, {cpu}}, [this] { main(); })
        .map([this](runtime::ThreadHandle &&thread) { thread_ = std::move(thread); });
  }

  // Ends the thread and adds its findings to `processor`.
  void join(WatchedProcessor &processor) {
    if (thread_.joinable()) thread_.join();
    for (std::size_t i = 0; i < count_; ++i) {
      gaps_[i].at += processor.watched;
      processor.gaps.push_back(gaps_[i]);
    }
    processor.watched += watched_;
  }

 private:
  [[nodiscard]] bool stopped() const { return stop_ != nullptr && stop_->load(); }

  void main() {
    const Time end = runtime::monotonic_now() + length_;
    runtime::Event never;
    for (Time now = runtime::monotonic_now(); now < end && !stopped(); now = runtime::monotonic_now()) {
      watch(std::min(now + kBurst, end));
      // Ordinary threads pause as well, and other threads that want to run do so during the pause.
      never.wait_until(runtime::monotonic_now() + kPause);
    }
  }

  void watch(Time until) {
    Duration cpu = runtime::thread_cpu_now();
    Time read_at = runtime::monotonic_now();
    const Time begun = read_at;
    Time last = read_at;
    for (Time now = runtime::monotonic_now(); now < until && count_ < kMostGaps;
         last = now, now = runtime::monotonic_now()) {
      const Duration length = now - last;
      if (length < kShortestGap) continue;
      const Duration used = runtime::thread_cpu_now();
      const Duration uncharged = (now - read_at) - (used - cpu);
      gaps_[count_++] = Gap{watched_ + now - begun, length, std::clamp<Duration>(length - uncharged, 0, length)};
      cpu = used;
      read_at = now = runtime::monotonic_now();
    }
    watched_ += last - begun;
  }

  Duration length_;
  const std::atomic<bool> *stop_;
  std::vector<Gap> gaps_;  // their pages are touched before the measurement
  std::size_t count_ = 0;
  Duration watched_ = 0;
  runtime::ThreadHandle thread_;
};

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

// Returns the 99.9th percentile of the differences between readings of a thread's processor-time clock.
Duration clock_cost() {
  constexpr int kReadings = 20'000;
  std::vector<Duration> costs;
  Duration before = runtime::thread_cpu_now();
  for (int i = 0; i < kReadings; ++i) {
    const Duration now = runtime::thread_cpu_now();
    costs.push_back(now - before);
    before = now;
  }
  std::sort(costs.begin(), costs.end());
  return costs[costs.size() * 999 / 1000];
}

class Calibrating {
 public:
  explicit Calibrating(const CalibrateOptions &options)
      : options_(options), band_(runtime::probe_priority_band()), cpus_(runtime::usable_cpus()) {}

  Result<Calibration> run() {
    workload_ = calibration_workload(static_cast<std::uint32_t>(cpus_.size()));
    const Duration clock = clock_cost();
    const Time begun = runtime::monotonic_now();
    if (Result<void> done = measure(); !done) return tl::unexpected(done.error());
    result_.duration = runtime::monotonic_now() - begun;
    return conclude(clock);
  }

 private:
  struct Slice {
    bool realtime = false;
    bool stalls = false;
  };

  [[nodiscard]] bool stopped() const { return options_.stop != nullptr && options_.stop->load(); }

  // Measures all slices in turn, several times over: what changes during the measurement concerns them all.
  Result<void> measure() {
    std::vector<Slice> slices;
    for (const bool realtime : {true, false}) {
      if (realtime && band_.top_job == 0) continue;
      slices.push_back({realtime, false});
      slices.push_back({realtime, true});
    }
    const auto count = static_cast<Duration>(slices.size());
    constexpr Duration kRounds = 4;
    const Duration rounds = std::clamp<Duration>(options_.duration / (count * kShortestSlice), 1, kRounds);
    const Duration turns = std::max(rounds, options_.duration / (count * kLongestSlice) + 1);
    const Duration length = std::max<Duration>(options_.duration / (count * turns), 10 * kMillisecond);
    for (Duration done = 0; done < turns * count; ++done) {
      const Slice &slice = slices[static_cast<std::size_t>(done % count)];
      if (options_.progress) {
        options_.progress(static_cast<double>(done) / static_cast<double>(turns * count),
                          slice.stalls ? "stalls" : "dispatch, preemption, timer");
      }
      const Result<void> measured = slice.stalls ? watch_for_stalls(slice, length) : run_jobs(slice, length);
      if (!measured) return measured;
      if (stopped()) return make_error("interrupted: a part of a measurement can miss the largest values");
    }
    return {};
  }

  Findings &findings(const Slice &slice) { return findings_[slice.realtime ? 1 : 0]; }

  // Watches all processors at the same time. The threads have the lowest priority of all jobs: anything above them can
  // also take a processor from a job.
  Result<void> watch_for_stalls(const Slice &slice, Duration length) {
    std::vector<std::unique_ptr<Watcher>> watchers;
    Result<void> started;
    for (const int cpu : cpus_) {
      watchers.push_back(std::make_unique<Watcher>(length, options_.stop));
      started = watchers.back()->start(cpu, slice.realtime ? 1 : 0);
      if (!started) break;
    }
    for (std::size_t i = 0; i < watchers.size(); ++i) watchers[i]->join(findings(slice).processors[cpus_[i]]);
    return started;
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
      const std::vector<Duration> means = timer.take();
      found.timer.insert(found.timer.end(), means.begin(), means.end());
    });
  }

  Result<Calibration> conclude(Duration clock) {
    for (const bool realtime : {true, false}) {
      const Findings &found = findings_[realtime ? 1 : 0];
      if (!found.is_complete()) continue;
      Overheads charged;
      charged.timer = *std::max_element(found.timer.begin(), found.timer.end());
      charged.lateness = *std::max_element(found.lateness.begin(), found.lateness.end());
      charged.stall = found.loss(&Gap::length);
      charged.noise = found.loss(&Gap::charged);
      charged.clock = clock;
      Loss beyond;
      charged.dispatch = usual_delay(found.dispatch, found.ran, beyond);
      take_larger(charged.stall, beyond);
      charged.preempt = usual_delay(found.preempt, found.ran, beyond);
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
    result_.processors = static_cast<std::uint32_t>(cpus_.size());
    result_.processor = trace::this_machine().model;
    result_.rights = band_.top_job > 0 ? fmt::format("SCHED_FIFO up to {}", band_.timer) : "no SCHED_FIFO";
    return std::move(result_);
  }

  const CalibrateOptions &options_;
  runtime::PriorityBand band_;
  std::vector<int> cpus_;
  Workload workload_;
  std::uint64_t seed_ = 0;
  std::array<Findings, 2> findings_;  // by realtime
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

Loss fit_loss(std::span<const LossSample> samples, Duration watched) {
  Loss loss;
  if (samples.empty() || watched <= 0) return loss;
  Int128 sum = 0;
  for (const LossSample &sample : samples) sum += sample.length;
  // A processor that is lost most of the time guarantees nothing. The rate is capped just below one, and a bound then
  // reports the failure.
  const Int128 twice = (2 * sum * kSecond + watched - 1) / watched;
  loss.per_second = static_cast<Duration>(std::min<Int128>(twice, kSecond - kMillisecond));
  Duration level = 0;
  Duration at = 0;
  for (const LossSample &sample : samples) {
    const Int128 leaked = Int128{sample.at - at} * loss.per_second / kSecond;
    level = std::max<Duration>(0, level - static_cast<Duration>(leaked)) + sample.length;
    loss.longest = std::max(loss.longest, level);
    at = sample.at;
  }
  return loss;
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
