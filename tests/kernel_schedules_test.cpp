// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Judges what the kernel really ran in `os` mode. Random workloads run on real threads, and the kernel's own record of
// its context switches judges each run (tests/testing/kernel_judge.hpp). The reference scheduler, without a limit on
// threads, gives the priority levels. The judgement is thus independent of the scheduler, the engine and its pool.
//
// The tests need SCHED_FIFO and the right to perf_event_open. They are skipped, with the reason, if one is missing.
// REDAG_KERNEL_SCHEDULES sets the number of schedules, REDAG_KERNEL_SEED the first seed.
#include <sched.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cstdio>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "redag/derived/rng.hpp"
#include "redag/engine/preemption_point.hpp"
#include "redag/loader/validate.hpp"
#include "redag/sched/priority_scheduler.hpp"
#include "redag/threads/clock.hpp"
#include "redag/threads/threads.hpp"
#include "redag_lab/run/concurrency.hpp"
#include "redag_lab/run/run_workload.hpp"
#include "redag_lab/run/synthetic.hpp"
#include "tests/testing/builders.hpp"
#include "tests/testing/environment.hpp"
#include "tests/testing/kernel_judge.hpp"
#include "tests/testing/reference_scheduler.hpp"

namespace redag::testing {
namespace {

using runtime::Body;
using runtime::Job;
using sched::Outcome;

pid_t this_thread() { return static_cast<pid_t>(::syscall(SYS_gettid)); }

// Records when and on which thread the bodies of a run began and ended.
class BodyLog {
 public:
  explicit BodyLog(std::size_t room) : runs_(room) {}

  Body noted(Body body) {
    return [this, body = std::move(body)](const Job &job) {
      BodyRun *const run = next();
      if (run != nullptr) *run = {{job.task.value, job.number}, this_thread(), runtime::monotonic_now(), kNever};
      struct End {
        ~End() {
          if (run != nullptr) run->end = runtime::monotonic_now();
        }
        BodyRun *run;
      } const end{run};
      return body(job);
    };
  }
  /// The recorded bodies. Call it when no body runs.
  [[nodiscard]] std::optional<std::vector<BodyRun>> runs() const {
    if (used_ > runs_.size()) return std::nullopt;
    return std::vector<BodyRun>(runs_.begin(), runs_.begin() + static_cast<std::ptrdiff_t>(used_.load()));
  }

 private:
  BodyRun *next() {
    const std::size_t at = used_.fetch_add(1);
    return at < runs_.size() ? &runs_[at] : nullptr;
  }

  std::vector<BodyRun> runs_;
  std::atomic<std::size_t> used_{0};
};

struct Tally {
  std::uint64_t schedules = 0;
  std::uint64_t dropped = 0;  // runs whose kernel record was incomplete
  std::uint64_t instants = 0;
  std::uint64_t contended = 0;
  std::uint64_t bodies = 0;
  std::uint64_t switches = 0;
};

// ---- random workloads: unlike testing::contended(), with jobs long enough for the kernel to switch threads ----

constexpr std::array<Duration, 8> kPeriods{4 * kMillisecond,  5 * kMillisecond,  8 * kMillisecond,  10 * kMillisecond,
                                           15 * kMillisecond, 20 * kMillisecond, 30 * kMillisecond, 60 * kMillisecond};

Task random_task(Rng &rng, std::size_t number, double utilization, Criticality criticality) {
  Task task;
  task.name = fmt::format("t{}", number);
  task.period = task.deadline = kPeriods[static_cast<std::size_t>(rng.uniform(0, kPeriods.size() - 1))];
  task.offset = rng.uniform(0, 5) * kMillisecond;
  task.wcet =
      std::max<Duration>(50 * kMicrosecond, static_cast<Duration>(static_cast<double>(task.period) * utilization));
  task.bcet = task.wcet / 2;
  task.region = 100 * kMicrosecond;
  task.priority = static_cast<int>(rng.uniform(0, 9));
  const double kind = rng.uniform01();
  if (kind < 0.2) {
    task.group = rng.uniform01() < 0.5 ? "g" : "h";
  } else if (kind < 0.4) {
    task.concurrency = 2;
    task.overrun = Overrun::Queue;
    task.queue_depth = 2;
  }
  if (criticality == Criticality::High && rng.uniform01() < 0.3) {
    task.wcet_low = task.wcet / 2;
  } else if (rng.uniform01() < 0.2) {
    task.budget = task.wcet / 2;
    task.on_budget = rng.uniform01() < 0.5 ? OnBudget::Demote : OnBudget::Log;
  }
  return task;
}

Dag random_dag(Rng &rng, std::size_t number, double utilization) {
  Dag dag;
  dag.name = fmt::format("d{}", number);
  dag.criticality = rng.uniform01() < 0.4 ? Criticality::High : Criticality::Low;
  const auto tasks = static_cast<std::size_t>(rng.uniform(1, 3));
  for (std::size_t i = 0; i < tasks; ++i) {
    dag.tasks.push_back(random_task(rng, i, utilization / static_cast<double>(tasks), dag.criticality));
    Task &task = dag.tasks.back();
    if (i == 0 || rng.uniform01() < 0.6) continue;
    task.activation = Activation::Data;
    task.period = task.deadline = task.offset = 0;
    task.predecessors = {static_cast<std::uint32_t>(i - 1)};
    task.wcet = task.bcet = std::min(task.wcet, kMillisecond);
    task.wcet_low = task.budget = 0;
    task.concurrency = 1;
    task.overrun = Overrun::Skip;
    task.queue_depth = 0;
  }
  if (rng.uniform01() < 0.2) dag.max_active = static_cast<std::uint32_t>(rng.uniform(1, 2));
  inherit_periods(dag);
  return dag;
}

Workload random_workload(Rng &rng, std::uint32_t workers) {
  for (;;) {
    Workload workload;
    workload.name = "kernel";
    workload.platform = Platform{workers, PreemptionMode::Os};
    workload.policy = rng.uniform01() < 0.7 ? PolicyKind::RateMonotonic : PolicyKind::Fixed;
    const auto dags = static_cast<std::size_t>(rng.uniform(2, std::max(4U, workers)));
    const double load = (0.6 + 0.8 * rng.uniform01()) * workers / static_cast<double>(dags);
    for (std::size_t d = 0; d < dags; ++d) workload.dags.push_back(random_dag(rng, d, load));
    const Diagnostics findings = validate(workload);
    if (!has_errors(findings)) return workload;
  }
}

// ---- schedules ----

class KernelSchedules : public ::testing::Test {
 protected:
  void SetUp() override {
    if (band_.top_job == 0)
      GTEST_SKIP() << "nothing is judged: this process may not use SCHED_FIFO: " << runtime::realtime_hint();
    bool is_fifo = false;
    auto thread =
        runtime::start_thread({"fifo", 7, {}}, [&] { is_fifo = ::syscall(SYS_sched_getscheduler, 0) == SCHED_FIFO; });
    ASSERT_TRUE(thread);
    thread->join();
    if (!is_fifo) GTEST_SKIP() << "nothing is judged: priorities are in name only (a build with sanitizers)";
    const auto recorder = SwitchRecorder::start(runtime::usable_cpus(), kBeat);
    if (!recorder) GTEST_SKIP() << "nothing is judged: " << to_string(recorder.error());
  }

  // The last processors, which the engine takes as well.
  static std::vector<int> cpus_of(std::uint32_t workers) {
    std::vector<int> cpus = runtime::usable_cpus();
    cpus.erase(cpus.begin(), cpus.end() - static_cast<std::ptrdiff_t>(workers));
    return cpus;
  }
  static std::uint32_t random_workers(Rng &rng) {
    const auto most = static_cast<std::int64_t>(std::min<std::size_t>(16, runtime::usable_cpus().size()));
    return static_cast<std::uint32_t>(rng.uniform(1, most));
  }

  // Compares what the kernel ran with what the reference scheduler would have run.
  void judge_run(SwitchRecorder recorder, const BodyLog &bodies, const RecordingScheduler::Log &log,
                 const Workload &workload, sched::Config config, const std::string &replay) {
    Result<std::vector<SwitchEvent>> events = recorder.stop();
    std::optional<std::vector<BodyRun>> runs = bodies.runs();
    if (!events || !runs) {
      ++tally_.dropped;
      return;
    }
    config.max_started = 0;
    ReferenceScheduler reference(workload, config);
    std::size_t differences = 0;
    KernelRun run;
    run.decisions = RecordingScheduler::replay(log, reference, differences);
    run.events = *std::move(events);
    run.bodies = *std::move(runs);
    run.cpus = cpus_of(config.workers);
    const KernelVerdict verdict = judge(run);
    EXPECT_EQ(verdict.violation_count, 0U) << fmt::format("{}\n{}", fmt::join(verdict.violations, "\n"), replay);
    EXPECT_EQ(differences, 0U) << replay;
    ++tally_.schedules;
    tally_.instants += verdict.instants;
    tally_.contended += verdict.contended;
    tally_.bodies += run.bodies.size();
    tally_.switches += run.events.size();
  }

  // Runs a workload as `redag run` does.
  void run_as_workload(const Workload &workload, std::uint64_t seed, const std::string &replay) {
    const auto log = RecordingScheduler::make_log();
    BodyLog bodies(1U << 14U);
    lab::RunOptions options;
    options.duration = 150 * kMillisecond;
    options.seed = seed;
    sched::Config used;
    options.scheduler = [&](const Workload &w, const sched::Config &config) {
      used = config;
      return std::make_unique<RecordingScheduler>(std::make_unique<sched::PriorityScheduler>(w, config), log);
    };
    options.bodies = [&](std::vector<Body> synthetic, const lab::Now & /*now*/) {
      for (Body &body : synthetic) body = bodies.noted(std::move(body));
      return synthetic;
    };
    auto recorder = SwitchRecorder::start(cpus_of(workload.platform.workers), kBeat);
    ASSERT_TRUE(recorder);
    const auto result = lab::run_workload(workload, options);
    ASSERT_TRUE(result) << to_string(result.error());
    judge_run(*std::move(recorder), bodies, *log, workload, used, replay);
  }

  void run_reconfigured(std::uint64_t seed, const std::string &replay);

  // Runs both kinds of schedules in turn.
  void run_many(std::uint64_t first, std::uint64_t count) {
    for (std::uint64_t seed = first; seed < first + count && !HasFailure(); ++seed) {
      const std::string replay = fmt::format(
          "replay: REDAG_KERNEL_SEED={} REDAG_KERNEL_SCHEDULES=1 redag_integration_test "
          "--gtest_filter='KernelSchedules.*'",
          seed);
      if (seed % 3 == 0) {
        Rng rng(seed);
        run_as_workload(random_workload(rng, random_workers(rng)), seed, replay);
      } else {
        run_reconfigured(seed, replay);
      }
    }
  }

  const runtime::PriorityBand band_ = runtime::probe_priority_band();
  Tally tally_;
};

// A run in which DAGs and tasks come, go and change their periods. One thread, above all jobs, releases jobs at random.
class ChangingRun {
 public:
  ChangingRun(Rng &rng, runtime::Engine &engine, BodyLog &bodies, const Workload &workload)
      : rng_(rng), engine_(engine), bodies_(bodies) {
    for (const Dag &dag : workload.dags) {
      std::vector<TaskId> ids;
      for (std::size_t i = 0; i < dag.tasks.size(); ++i) ids.emplace_back(next_++);
      know(DagId(next_dag_++), dag, ids);
    }
  }

  std::vector<Body> bodies_of(const Dag &dag) {
    std::vector<Body> bodies;
    for (const Task &task : dag.tasks) bodies.push_back(bodies_.noted(body_of(task)));
    return bodies;
  }

  void go(Duration length) {
    const Time end = engine_.now() + length;
    while (engine_.now() < end) {
      act();
      runtime::Event never;
      never.wait_until(runtime::monotonic_now() + rng_.uniform(100, 3000) * kMicrosecond);
    }
  }

 private:
  struct Known {
    DagId id;
    std::vector<TaskId> tasks;
    std::vector<TaskId> timers;
  };

  static Body body_of(const Task &task) {
    return [task](const Job &job) {
      static const std::atomic<bool> kNever{false};
      Rng rng(job.task.value * 7919ULL + job.number);
      lab::burn(rng.uniform(task.bcet, task.wcet), task.region, kNever);
      return Outcome::Finished;
    };
  }

  void know(DagId id, const Dag &dag, const std::vector<TaskId> &ids) {
    Known known{id, ids, {}};
    for (std::size_t i = 0; i < ids.size(); ++i) {
      if (dag.tasks[i].activation == Activation::Timer) known.timers.push_back(ids[i]);
    }
    dags_.push_back(known);
  }

  void act() {
    const double what = rng_.uniform01();
    if (what < 0.06 && dags_.size() < 6) {
      const Dag dag = random_dag(rng_, next_dag_++, 0.3);
      const runtime::AddedDag added = engine_.add_dag(dag, bodies_of(dag));
      know(added.dag, dag, added.tasks);
    } else if (what < 0.10 && dags_.size() > 2) {
      const std::size_t gone = any(dags_.size());
      engine_.remove_dag(dags_[gone].id);
      dags_.erase(dags_.begin() + static_cast<std::ptrdiff_t>(gone));
    } else if (what < 0.18) {
      const Known &dag = dags_[any(dags_.size())];
      const Duration period = kPeriods[any(kPeriods.size())];
      engine_.set_timing(dag.tasks[any(dag.tasks.size())], period, period);
    } else {
      release();
    }
  }

  void release() {
    std::vector<runtime::Release> releases;
    const auto count = static_cast<std::size_t>(rng_.uniform(1, 3));
    for (std::size_t i = 0; i < count; ++i) {
      const Known &dag = dags_[any(dags_.size())];
      releases.push_back({dag.timers[any(dag.timers.size())], engine_.now()});
    }
    engine_.release(releases);
  }

  std::size_t any(std::size_t size) {
    return static_cast<std::size_t>(rng_.uniform(0, static_cast<std::int64_t>(size) - 1));
  }

  Rng &rng_;
  runtime::Engine &engine_;
  BodyLog &bodies_;
  std::vector<Known> dags_;
  std::size_t next_ = 0;
  std::size_t next_dag_ = 0;
};

void KernelSchedules::run_reconfigured(std::uint64_t seed, const std::string &replay) {
  Rng rng(seed);
  const std::uint32_t workers = random_workers(rng);
  const Workload workload = random_workload(rng, workers);
  runtime::EngineOptions options;
  options.config = runtime::make_config(runtime::Mode{PreemptionMode::Os, {}}, workers, workload.policy, band_, 64);
  options.band = band_;
  const auto log = RecordingScheduler::make_log();
  BodyLog bodies(1U << 14U);
  runtime::Engine engine(
      std::make_unique<RecordingScheduler>(std::make_unique<sched::PriorityScheduler>(workload, options.config), log),
      options);
  ChangingRun changing(rng, engine, bodies, workload);
  std::vector<Body> all;
  for (const Dag &dag : workload.dags) {
    for (Body &body : changing.bodies_of(dag)) all.push_back(std::move(body));
  }
  engine.bind(workload, std::move(all));
  auto recorder = SwitchRecorder::start(cpus_of(workers), kBeat);
  ASSERT_TRUE(recorder);
  ASSERT_TRUE(engine.start());
  engine.set_origin(runtime::monotonic_now());
  auto source = runtime::start_thread({"releases", band_.timer, {}}, [&] { changing.go(150 * kMillisecond); });
  ASSERT_TRUE(source);
  source->join();
  engine.halt();
  ASSERT_TRUE(engine.wait_idle(kNever));
  engine.join();
  judge_run(*std::move(recorder), bodies, *log, workload, options.config, replay);
}

TEST_F(KernelSchedules, TheMostUrgentStartedJobsHaveTheProcessors) {
  run_many(from_environment("REDAG_KERNEL_SEED").value_or(1), from_environment("REDAG_KERNEL_SCHEDULES").value_or(36));
  std::printf(
      "schedules judged: %lu (%lu more had a record with holes); %lu jobs, %lu events of the kernel; "
      "instants judged: %lu, %lu of them with a job that waited\n",
      static_cast<unsigned long>(tally_.schedules), static_cast<unsigned long>(tally_.dropped),
      static_cast<unsigned long>(tally_.bodies), static_cast<unsigned long>(tally_.switches),
      static_cast<unsigned long>(tally_.instants), static_cast<unsigned long>(tally_.contended));
}

// Two jobs of one task run for long. Each keeps its thread while it is preempted: the urgent job needs a third thread.
TEST_F(KernelSchedules, TheMostUrgentOfThreeJobsOfTwoTasksHasAProcessor) {
  if (runtime::usable_cpus().size() < 2) GTEST_SKIP() << "nothing is judged: one processor";
  const TestTask a = {.name = "a", .period = 4'000, .wcet = 200, .deadline = 1'000'000};
  const TestTask b = {.name = "b", .period = 50'000, .wcet = 90'000, .deadline = 1'000'000};
  Workload workload = make_workload({make_dag("urgent", {a}, 0, kMicrosecond), make_dag("slow", {b}, 0, kMicrosecond)},
                                    2, PreemptionMode::Os);
  for (Dag &dag : workload.dags) dag.tasks[0].region = 100 * kMicrosecond;
  workload.dags[1].tasks[0].concurrency = 2;
  ASSERT_FALSE(has_errors(validate(workload)));
  run_as_workload(workload, 1, "");
}

}  // namespace
}  // namespace redag::testing
