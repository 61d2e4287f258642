// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Measures the cost of a job besides its body: processor time with and without tracing, and context switches. Also
// measures the cost of an idle executor.
#include <benchmark/benchmark.h>
#include <sys/resource.h>

#include <atomic>
#include <chrono>
#include <memory>
#include <thread>
#include <vector>

#include "redag/engine/engine.hpp"
#include "redag/runtime/executor.hpp"
#include "redag/sched/priority_scheduler.hpp"
#include "redag/threads/clock.hpp"
#include "redag/threads/parker.hpp"

namespace {

using namespace redag;
using namespace redag::runtime;
using namespace std::chrono_literals;

Workload independent(std::size_t tasks) {
  Workload workload;
  workload.dags.emplace_back();
  for (std::size_t t = 0; t < tasks; ++t) {
    Task task;
    task.period = task.deadline = static_cast<Duration>(t + 1) * kMillisecond;
    task.wcet = kMillisecond;
    workload.dags[0].tasks.push_back(task);
  }
  return workload;
}

std::unique_ptr<Engine> start_engine(const Setup &setup, std::size_t tasks, std::size_t trace_capacity, Body body) {
  const Workload workload = independent(tasks);
  EngineOptions options;
  options.config = setup.config;
  options.band = setup.band;
  options.trace_capacity = trace_capacity;
  auto engine = std::make_unique<Engine>(std::make_unique<sched::PriorityScheduler>(workload, options.config), options);
  engine->bind(workload, std::vector<Body>(tasks, std::move(body)));
  engine->set_origin(monotonic_now());
  if (!engine->start()) std::abort();
  return engine;
}

Duration process_cpu_now() {
  timespec time{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &time);
  return time.tv_sec * kSecond + time.tv_nsec;
}

// Returns the context switches of all threads except the calling one.
std::int64_t switches_of_others() {
  rusage all{};
  rusage own{};
  getrusage(RUSAGE_SELF, &all);
  getrusage(RUSAGE_THREAD, &own);
  return all.ru_nvcsw + all.ru_nivcsw - own.ru_nvcsw - own.ru_nivcsw;
}

// Measures the processor time of jobs with empty bodies, each of which releases the next one, and of draining their
// events.
class JobCost {
 public:
  JobCost(const Setup &setup, std::size_t trace_capacity)
      : traced_(trace_capacity > 0), engine_(start_engine(setup, 1, trace_capacity, [this](const runtime::Job &job) {
          --left_ > 0 ? engine_->release(job.task, 0) : done_.unpark();
          return sched::Outcome::Finished;
        })) {
    batch();  // touches all memory
    used_ = 0;
    batches_ = 0;
  }

  void batch() {
    const Duration before = process_cpu_now();
    left_ = kJobs;
    engine_->release(TaskId(0), 0);
    done_.park();
    events_.clear();
    if (traced_) engine_->drain(events_);
    used_ += process_cpu_now() - before;
    ++batches_;
  }

  [[nodiscard]] double ns_per_job() const { return static_cast<double>(used_) / static_cast<double>(batches_ * kJobs); }
  [[nodiscard]] bool lost_some() const { return engine_->lost_events() > 0; }

  static constexpr std::size_t kRoom = 1U << 17U;  // events, enough for one batch

 private:
  static constexpr std::uint64_t kJobs = 20'000;

  bool traced_;
  std::uint64_t left_ = 0;
  Parker done_;
  std::vector<JobEvent> events_;
  Duration used_ = 0;
  std::uint64_t batches_ = 0;
  std::unique_ptr<Engine> engine_;  // last, because its threads use the other members
};

void trace(benchmark::State &state, const Setup &setup) {
  JobCost off(setup, 0);
  JobCost on(setup, JobCost::kRoom);
  for (auto _ : state) {
    for (int i = 0; i < 20; ++i) {
      off.batch();
      on.batch();
    }
  }
  if (on.lost_some()) return state.SkipWithError("events were lost: they would be too cheap");
  state.counters["off_cpu_ns/job"] = off.ns_per_job();
  state.counters["on_cpu_ns/job"] = on.ns_per_job();
  state.counters["percent_of_100us"] = (on.ns_per_job() - off.ns_per_job()) / (100'000 + off.ns_per_job()) * 100;
}

// Releases jobs one at a time and eight at a time to workers that sleep in between; reports context switches.
void switches(benchmark::State &state, const Setup &setup) {
  const auto burst = static_cast<std::uint32_t>(state.range(0));
  constexpr std::uint32_t kBursts = 500;
  std::atomic<std::uint32_t> left{0};
  Parker done;
  const auto engine = start_engine(setup, burst, 0, [&](const runtime::Job &) {
    if (left.fetch_sub(1) == 1) done.unpark();
    return sched::Outcome::Finished;
  });
  std::vector<Release> releases;
  for (std::uint32_t t = 0; t < burst; ++t) releases.push_back(Release{TaskId(t), 0});
  std::int64_t switches = 0;
  for (auto _ : state) {
    std::this_thread::sleep_for(10ms);
    const std::int64_t before = switches_of_others();
    for (std::uint32_t i = 0; i < kBursts; ++i) {
      left = burst;
      engine->release(releases);
      done.park();
      std::this_thread::sleep_for(500us);
    }
    switches += switches_of_others() - before;
  }
  state.counters["switches/job"] =
      static_cast<double>(switches) / static_cast<double>(state.iterations() * kBursts * burst);
}

// Runs the workers and the release timer with one task that is due in an hour.
void idle(benchmark::State &state, const Setup &setup) {
  ExecutorOptions options;
  options.preemption = setup.mode.mode;
  options.workers = setup.config.workers;
  Executor executor(options);
  DagBuilder dag("idle");
  TaskOptions later;
  later.offset = 1h;
  dag.timer(
      "later", 1h, [] {}, later);
  executor.add(std::move(dag));
  executor.start();
  std::this_thread::sleep_for(100ms);
  std::int64_t switches = 0;
  for (auto _ : state) {
    const std::int64_t before = switches_of_others();
    std::this_thread::sleep_for(1s);
    switches += switches_of_others() - before;
  }
  state.counters["switches/s"] = static_cast<double>(switches) / static_cast<double>(state.iterations());
  executor.stop();
}

[[maybe_unused]] const bool registered = [] {
  for (const PreemptionMode mode : {PreemptionMode::None, PreemptionMode::Os}) {
    const auto add = [mode](const std::string &name, std::uint32_t workers, auto function) {
      return benchmark::RegisterBenchmark((name + "/" + to_string(mode)).c_str(),
                                          [=](benchmark::State &state) {
                                            const Result<Setup> setup =
                                                set_up({.preemption = mode, .workers = workers});
                                            if (!setup) return state.SkipWithError("this mode cannot be had here");
                                            function(state, *setup);
                                          })
          ->Iterations(1)
          ->Unit(benchmark::kMillisecond);
    };
    add("trace", 1, trace);
    add("switches", 2, switches)->ArgName("burst")->Arg(1)->Arg(8);
    add("idle", 4, idle);
  }
  return true;
}();

}  // namespace
