// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/doctor/measure.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <string_view>
#include <utility>
#include <vector>

#include "redag/threads/clock.hpp"
#include "redag/threads/setup.hpp"
#include "redag/threads/threads.hpp"
#include "redag/trace/this_machine.hpp"
#include "redag_analysis/text/rounded_time.hpp"
#include "redag_lab/doctor/figures.hpp"
#include "redag_lab/doctor/measured_jobs.hpp"
#include "redag_lab/doctor/watch.hpp"
#include "redag_lab/run/run_workload.hpp"

namespace redag::doctor {
namespace {

constexpr Duration kShortestSlice = 250 * kMillisecond;
constexpr Duration kLongestSlice = 2 * kSecond;

void append(std::vector<LossSample> &to, std::span<const LossSample> from, Duration later) {
  for (const LossSample &sample : from) to.push_back({sample.at + later, sample.length});
}

// What was found of one class of threads.
struct Findings {
  std::vector<LossSample> dispatch;
  std::vector<LossSample> preempt;
  Duration ran = 0;  // wall-clock time of the runs with jobs
  std::vector<Duration> lateness;
  std::vector<Duration> timer;
  std::vector<WatchedProcessor> processors;

  void add(const TraceFigures &figures, Duration length) {
    lateness.insert(lateness.end(), figures.lateness.begin(), figures.lateness.end());
    append(dispatch, figures.dispatch, ran);
    append(preempt, figures.preempt, ran);
    ran += length;
  }

  [[nodiscard]] bool is_complete() const {
    return !lateness.empty() && !timer.empty() && !dispatch.empty() && !preempt.empty() &&
           std::any_of(processors.begin(), processors.end(), [](const auto &each) { return each.watched > 0; });
  }

  // The largest loss of all processors.
  [[nodiscard]] Loss loss(Duration Gap::*part) const {
    Loss worst;
    for (const WatchedProcessor &processor : processors) take_larger(worst, processor.loss(part));
    return worst;
  }
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

class Measuring {
 public:
  explicit Measuring(const MeasureOptions &options)
      : options_(options), band_(runtime::probe_priority_band()), cpus_(runtime::usable_cpus()) {}

  Result<Measurement> run() {
    workload_ = measured_workload(static_cast<std::uint32_t>(cpus_.size()));
    const Duration clock = clock_cost();
    const Time begun = runtime::monotonic_now();
    if (Result<void> done = measure_slices(); !done) return tl::unexpected(done.error());
    result_.calibration.duration = runtime::monotonic_now() - begun;
    return conclude(clock);
  }

 private:
  struct Slice {
    const char *name;
    Result<void> (Measuring::*measure)(bool realtime, Duration length);
    bool realtime;
  };

  // Measures all slices in turn, several times over: what changes during the measurement concerns them all.
  Result<void> measure_slices() {
    std::vector<Slice> slices;
    for (const bool realtime : {true, false}) {
      if (realtime && band_.top_job == 0) continue;
      if (slices.empty()) slices.push_back({"wake-ups", &Measuring::wake_up, realtime});
      slices.push_back({"dispatch, preemption, timer", &Measuring::run_jobs, realtime});
      slices.push_back({"stalls", &Measuring::watch_for_stalls, realtime});
    }
    const auto count = static_cast<Duration>(slices.size());
    constexpr Duration kRounds = 4;
    const Duration rounds = std::clamp<Duration>(options_.duration / (count * kShortestSlice), 1, kRounds);
    const Duration turns = std::max(rounds, options_.duration / (count * kLongestSlice) + 1);
    const Duration length = std::max<Duration>(options_.duration / (count * turns), 10 * kMillisecond);
    for (Duration done = 0; done < turns * count; ++done) {
      const Slice &slice = slices[static_cast<std::size_t>(done % count)];
      if (options_.progress) {
        options_.progress(static_cast<double>(done) / static_cast<double>(turns * count), slice.name);
      }
      if (Result<void> measured = (this->*slice.measure)(slice.realtime, length); !measured) return measured;
      if (options_.stop->load()) {
        return make_error("interrupted: a part of a measurement can miss the largest values");
      }
    }
    return {};
  }

  // Runs `watch` for each processor at the same time, on a thread there.
  Result<void> on_processors(int fifo_priority, const std::function<void(std::size_t index)> &watch) {
    std::vector<runtime::ThreadHandle> threads;
    Result<void> started;
    for (std::size_t i = 0; i < cpus_.size() && started; ++i) {
      started = runtime::start_thread({"redag-watch", fifo_priority, {cpus_[i]}}, [&watch, i] {
                  watch(i);
                }).map([&](runtime::ThreadHandle &&thread) { threads.push_back(std::move(thread)); });
    }
    for (runtime::ThreadHandle &thread : threads) thread.join();
    return started;
  }

  // The threads have the priority of the release timer.
  Result<void> wake_up(bool realtime, Duration length) {
    Histogram latencies;
    Result<void> done = on_processors(
        realtime ? band_.timer : 0, [&](std::size_t /*index*/) { watch_wake_ups(length, *options_.stop, latencies); });
    result_.wake_ups += latencies.counts();
    return done;
  }

  // The threads have the lowest priority of all jobs: anything above them can also take a processor from a job.
  Result<void> watch_for_stalls(bool realtime, Duration length) {
    std::vector<WatchedProcessor> &processors = findings(realtime).processors;
    processors.resize(cpus_.size());
    return on_processors(realtime ? 1 : 0,
                         [&](std::size_t index) { watch_gaps(length, *options_.stop, processors[index]); });
  }

  Result<void> run_jobs(bool realtime, Duration length) {
    AbsenceRecorder recorder(workload_.task_count());
    TimerWatch timer(workload_);
    lab::RunOptions run;
    run.duration = length;
    run.preemption = realtime ? PreemptionMode::Os : PreemptionMode::Cooperative;
    run.stop = options_.stop;
    run.seed = ++seed_;
    run.bodies = [&](std::vector<runtime::Body> bodies, const lab::Now &now) {
      return recorder.replace(workload_, std::move(bodies), now);
    };
    run.progress = [&](Time, std::span<const JobEvent> events) { timer.look(events); };
    return lab::run_workload(workload_, run).map([&](const lab::RunResult &result) {
      Findings &found = findings(realtime);
      found.add(figures_of(workload_, result.trace.events, recorder.absences()), result.trace.info.end);
      found.timer.insert(found.timer.end(), timer.means().begin(), timer.means().end());
    });
  }

  Findings &findings(bool realtime) { return findings_[realtime ? 1 : 0]; }

  Result<Measurement> conclude(Duration clock) {
    Calibration &calibration = result_.calibration;
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
      (realtime ? calibration.realtime : calibration.normal) = charged;
    }
    if (!calibration.realtime && !calibration.normal) {
      return make_error("the measurement ended before everything was measured once: there is nothing to write",
                        "on most machines, a second is long enough");
    }
    calibration.processors = static_cast<std::uint32_t>(cpus_.size());
    calibration.processor = trace::this_machine().model;
    calibration.rights = band_.top_job > 0 ? fmt::format("SCHED_FIFO up to {}", band_.timer) : "no SCHED_FIFO";
    return std::move(result_);
  }

  const MeasureOptions &options_;
  runtime::PriorityBand band_;
  std::vector<int> cpus_;
  Workload workload_;
  std::uint64_t seed_ = 0;
  std::array<Findings, 2> findings_;  // by realtime
  Measurement result_;
};

}  // namespace

Result<Measurement> measure(const MeasureOptions &options) { return Measuring(options).run(); }

}  // namespace redag::doctor
