// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Measures how fast a job starts on a sleeping worker: from release() to the first line of its body, and from its
// instant on the release timer's grid. Each sample has a reference from the same run, the least that Linux needs: a
// futex wake of a thread, and a thread that sleeps until an absolute time. All threads have the priorities and the
// timer slack that the mode gives the runtime's threads. preemption_latency.cpp measures busy processors.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <ctime>
#include <memory>
#include <thread>
#include <vector>

#include "redag/engine/engine.hpp"
#include "redag/runtime/release_timer.hpp"
#include "redag/sched/priority_scheduler.hpp"
#include "redag/threads/clock.hpp"
#include "redag/threads/threads.hpp"

namespace {

using namespace redag;
using namespace redag::runtime;

constexpr Duration kPeriod = kMillisecond;
constexpr int kSamples = 1000;  // per iteration

void sleep_until(Time monotonic) {
  const timespec until{static_cast<std::time_t>(monotonic / kSecond), static_cast<long>(monotonic % kSecond)};
  while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &until, nullptr) != 0) {
  }
}

Workload one_task() {
  Workload workload;
  workload.policy = PolicyKind::Fixed;
  workload.dags.emplace_back();
  Task task;
  task.period = task.deadline = task.wcet = kPeriod;
  workload.dags[0].tasks.push_back(task);
  return workload;
}

class OneTask {
 public:
  /// `releases` can be null.
  OneTask(const Setup &setup, const Body &body, ReleaseThread *releases = nullptr) {
    const Workload workload = one_task();
    EngineOptions options;
    options.config = setup.config;
    options.band = setup.band;
    engine_ = std::make_unique<Engine>(std::make_unique<sched::PriorityScheduler>(workload, options.config), options);
    std::vector<Body> bodies(1, body);
    engine_->bind(workload, std::move(bodies));
    if (releases != nullptr) engine_->share_releases(*releases);
    if (!engine_->start()) std::abort();
  }
  Engine &engine() { return *engine_; }

 private:
  std::unique_ptr<Engine> engine_;
};

struct Samples {
  std::vector<Duration> bare;
  std::vector<Duration> ours;

  static double quantile_us(std::vector<Duration> &of, double q) {
    const auto at = of.begin() + static_cast<std::ptrdiff_t>(q * static_cast<double>(of.size() - 1));
    std::nth_element(of.begin(), at, of.end());
    return static_cast<double>(*at) / 1e3;
  }
  void tell(benchmark::State &state) {
    for (const auto &[name, q] : {std::pair{"p50", 0.5}, std::pair{"p99", 0.99}}) {
      const double theirs = quantile_us(bare, q);
      const double mine = quantile_us(ours, q);
      state.counters[std::string("bare_") + name + "_us"] = theirs;
      state.counters[std::string("redag_") + name + "_us"] = mine;
      state.counters[std::string("ratio_") + name] = mine / theirs;
    }
  }
};

void release(benchmark::State &state, const Setup &setup) {
  Samples samples;
  Time begun = 0;  // published by `answered`
  Parker answered;
  Parker wake;
  bool over = false;
  const auto answer = [&] {
    begun = monotonic_now();
    answered.unpark();
  };
  OneTask task(setup, [&](const runtime::Job &) {
    answer();
    return sched::Outcome::Finished;
  });
  const int job_priority = setup.mode.mode == PreemptionMode::Os ? setup.band.top_job : 0;
  Result<ThreadHandle> bare = start_thread(ThreadSetup{"bare", job_priority, {}}, [&] {
    for (wake.park(); !over; wake.park()) answer();
  });
  if (!bare) std::abort();
  Result<ThreadHandle> source = start_thread(ThreadSetup{"source", setup.timer_priority(), {}}, [&] {
    for (auto _ : state) {
      for (int i = 0; i < kSamples; ++i) {
        sleep_until(monotonic_now() + kPeriod / 2);
        Time from = monotonic_now();
        wake.unpark();
        answered.park();
        samples.bare.push_back(begun - from);
        sleep_until(monotonic_now() + kPeriod / 2);
        from = monotonic_now();
        task.engine().release(TaskId(0), 0);
        answered.park();
        samples.ours.push_back(begun - from);
      }
    }
  });
  if (!source) std::abort();
  source->join();
  over = true;
  wake.unpark();
  bare->join();
  samples.tell(state);
}

void timer(benchmark::State &state, const Setup &setup) {
  Samples samples;
  samples.ours.reserve(kSamples);
  for (auto _ : state) {
    OneTask *self = nullptr;
    Event done;
    std::vector<Duration> ours;
    ours.reserve(kSamples);
    ReleaseTimer releases([&](std::span<const Release> due) { self->engine().release(due); }, 0);
    const auto body = [&](const runtime::Job &job) {
      const Time begun = self->engine().now();
      if (ours.size() < kSamples) ours.push_back(begun - job.release);
      if (ours.size() == kSamples) done.set();
      return sched::Outcome::Finished;
    };
    OneTask task(setup, body, &releases.thread());
    self = &task;
    const Time origin = monotonic_now() + 20 * kMillisecond;
    task.engine().set_origin(origin);
    constexpr TaskId kOnly(0);
    releases.add(one_task().dags[0], std::span(&kOnly, 1), 0);
    if (!releases.start(origin, kNever, ThreadSetup{"timer", setup.timer_priority(), {}})) std::abort();
    // Wakes half a period after each release.
    Result<ThreadHandle> bare = start_thread(ThreadSetup{"bare", setup.timer_priority(), {}}, [&] {
      for (Time at = origin + kPeriod / 2; !done.is_set(); at += kPeriod) {
        sleep_until(at);
        samples.bare.push_back(monotonic_now() - at);
      }
    });
    if (!bare) std::abort();
    done.wait();
    bare->join();
    releases.stop();
    releases.join();
    samples.ours.insert(samples.ours.end(), ours.begin(), ours.end());
  }
  samples.tell(state);
}

[[maybe_unused]] const bool registered = [] {
  for (const PreemptionMode mode : {PreemptionMode::None, PreemptionMode::Os}) {
    const auto add = [mode](const std::string &name, void (*function)(benchmark::State &, const Setup &)) {
      benchmark::RegisterBenchmark((name + "/" + to_string(mode)).c_str(),
                                   [=](benchmark::State &state) {
                                     const Result<Setup> setup =
                                         set_up({.preemption = mode, .policy = PolicyKind::Fixed, .workers = 1});
                                     if (!setup) return state.SkipWithError("this mode cannot be had here");
                                     function(state, *setup);
                                   })
          ->Iterations(1)
          ->UseRealTime()
          ->Unit(benchmark::kMillisecond);
    };
    add("release", release);
    add("timer", timer);
  }
  return true;
}();

}  // namespace
