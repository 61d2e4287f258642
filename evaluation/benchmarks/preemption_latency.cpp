// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Measures how fast a more urgent job starts in os mode when every processor runs less urgent jobs. The latency is from
// release() to the first line of the job's body. Each sample has a reference from the same run: a futex wake of a
// SCHED_FIFO thread that has to preempt one of the same busy threads. This is the least that Linux needs.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <ctime>
#include <memory>
#include <thread>
#include <vector>

#include "redag/engine/engine.hpp"
#include "redag/sched/priority_scheduler.hpp"
#include "redag/threads/clock.hpp"
#include "redag/threads/threads.hpp"

namespace {

using namespace redag;
using namespace redag::runtime;

// Runs a busy job on every processor, one urgent task, and one urgent bare thread for reference.
class Machine {
 public:
  explicit Machine(const PriorityBand &band) : band_(band) {
    const auto cpus = static_cast<std::uint32_t>(usable_cpus().size());
    workload_.policy = PolicyKind::Fixed;
    workload_.dags.emplace_back();
    for (std::uint32_t t = 0; t <= cpus; ++t) {
      Task task;
      task.period = task.deadline = task.wcet = kSecond;
      task.priority = t == 0 ? 1 : 0;
      workload_.dags[0].tasks.push_back(task);
    }
    EngineOptions options;
    options.band = band;
    options.config = make_config(Mode{PreemptionMode::Os, {}}, cpus, workload_.policy, band, cpus + 2);
    auto scheduler = std::make_unique<sched::PriorityScheduler>(workload_, options.config);
    engine_ = std::make_unique<Engine>(std::move(scheduler), options);
    std::vector<Body> bodies(cpus + 1, [this](const Job &) {
      busy_.fetch_add(1);
      while (!done_.load(std::memory_order_relaxed)) {
      }
      return sched::Outcome::Finished;
    });
    bodies[0] = [this](const Job &) {
      begun_ = monotonic_now();
      answered_.unpark();
      return sched::Outcome::Finished;
    };
    engine_->bind(workload_, std::move(bodies));
    if (!engine_->start()) std::abort();
    bare_ = std::thread([this] { serve(); });
    (void)set_fifo_priority(pthread_self(), band.timer);  // this thread acts as the release timer
    for (std::uint32_t t = 1; t <= cpus; ++t) engine_->release(TaskId(t), 0);
    while (busy_ < cpus) pause();
  }

  ~Machine() {
    done_ = true;
    wake_.unpark();
    bare_.join();
  }

  Duration futex_wake() {
    pause();
    const Time woken = monotonic_now();
    wake_.unpark();
    answered_.park();
    return begun_ - woken;
  }

  Duration release() {
    pause();
    const Time released = monotonic_now();
    engine_->release(TaskId(0), 0);
    answered_.park();
    return begun_ - released;
  }

 private:
  void serve() {
    (void)set_fifo_priority(pthread_self(), band_.top_job);
    for (;;) {
      wake_.park();
      if (done_) return;
      begun_ = monotonic_now();
      answered_.unpark();
    }
  }

  static void pause() {
    const timespec half_a_millisecond{0, 500'000};
    nanosleep(&half_a_millisecond, nullptr);
  }

  PriorityBand band_;
  Workload workload_;
  std::atomic<std::uint32_t> busy_{0};
  std::atomic<bool> done_{false};
  Time begun_ = 0;  // published by answered_
  Parker wake_;
  Parker answered_;
  std::unique_ptr<Engine> engine_;
  std::thread bare_;
};

double quantile_us(std::vector<Duration> &samples, double q) {
  const auto at = samples.begin() + static_cast<std::ptrdiff_t>(q * static_cast<double>(samples.size() - 1));
  std::nth_element(samples.begin(), at, samples.end());
  return static_cast<double>(*at) / 1e3;
}

void preemption_latency(benchmark::State &state) {
  const PriorityBand band = probe_priority_band();
  if (band.top_job == 0) {
    state.SkipWithError("this process may not use SCHED_FIFO");
    return;
  }
  std::vector<Duration> bare;
  std::vector<Duration> ours;
  // The thread becomes real-time, and therefore is not the one that runs the benchmarks.
  std::thread([&] {
    Machine machine(band);
    for (auto iteration : state) {
      bare.push_back(machine.futex_wake());
      ours.push_back(machine.release());
      state.SetIterationTime(static_cast<double>(ours.back()) / 1e9);
    }
  }).join();
  state.counters["futex_p50_us"] = quantile_us(bare, 0.5);
  state.counters["futex_p99_us"] = quantile_us(bare, 0.99);
  state.counters["release_p50_us"] = quantile_us(ours, 0.5);
  state.counters["release_p99_us"] = quantile_us(ours, 0.99);
  state.counters["ratio_p50"] = quantile_us(ours, 0.5) / quantile_us(bare, 0.5);
  state.counters["ratio_p99"] = quantile_us(ours, 0.99) / quantile_us(bare, 0.99);
}
BENCHMARK(preemption_latency)->Iterations(500)->Repetitions(5)->UseManualTime()->Unit(benchmark::kMicrosecond);

}  // namespace
