// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// A day of scheduler time in the simulator, for random task sets, to find what a long run could wear out.
// REDAG_LONG_RUN=<n> runs n task sets (24 by default), each for 24 hours (otherwise for 2). REDAG_LONG_RUN_SEED=<s> is
// the first seed (default 1).
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>
#include <optional>
#include <span>
#include <vector>

#include <fmt/format.h>

#include "redag/derived/rng.hpp"
#include "redag_analysis/analyze/analyze.hpp"
#include "redag_analysis/executors/executors.hpp"
#include "redag_analysis/metrics/deadline_watch.hpp"
#include "redag_analysis/sim/simulator.hpp"
#include "redag_lab/workload/generate.hpp"
#include "tests/testing/allocation_counter.hpp"
#include "tests/testing/environment.hpp"

namespace redag::testing {
namespace {

constexpr Duration kHour = 3600 * kSecond;

// A random task set with a load from far below the workers' capacity to slightly above it, and everything that makes
// jobs wait. Apart from contended(), because docs/evidence/robustness.md has the figures of these seeds.
Workload random_task_set(std::uint64_t seed) {
  Rng rng(seed);
  lab::GenerateOptions options;
  options.dags = static_cast<std::uint32_t>(rng.uniform(2, 4));
  options.min_tasks = 1;
  options.max_tasks = 4;
  options.workers = static_cast<std::uint32_t>(rng.uniform(1, 4));
  constexpr PreemptionMode kModes[] = {PreemptionMode::None, PreemptionMode::Os};
  options.preemption = kModes[rng.uniform(0, 1)];
  options.policy = static_cast<PolicyKind>(rng.uniform(0, 5));
  options.utilization = options.workers * (0.2 + 0.9 * rng.uniform01());
  options.utilization = std::min(options.utilization, static_cast<double>(options.dags) * 0.9);
  options.period_min = kSecond;
  options.period_max = 60 * kSecond;
  options.bcet_min = 0.5;
  options.data_share = rng.uniform01();
  options.offsets = rng.uniform01() < 0.5;
  options.jitter = rng.uniform01() < 0.3 ? 0.1 : 0.0;
  options.max_active_max = static_cast<std::uint32_t>(rng.uniform(0, 2));
  options.groups = static_cast<std::uint32_t>(rng.uniform(0, 2));
  options.group_share = options.groups > 0 ? 0.3 : 0.0;
  options.queue_share = 0.3;
  const Result<Workload> workload = generate(options, seed);
  return workload ? *workload : Workload{};
}

struct Figures {
  std::uint64_t task_sets = 0;
  std::uint64_t jobs = 0;
  std::uint64_t lost = 0;
  std::uint64_t bounded = 0;  // tasks and DAGs with a bound
  double largest_ratio = 0;   // observed / bound
};

// Checks the events as they arrive.
class Day {
 public:
  Day(const Workload &workload, const analysis::Report &report)
      : report_(report),
        watch_(workload),
        released_(workload.task_count()),
        finished_(workload.task_count()),
        lost_(workload.task_count()),
        slowest_(workload.task_count()),
        slowest_dag_(workload.dags.size()) {
    for (const TaskRef &ref : flatten(workload)) dag_of_.push_back(ref.dag.value);
  }

  void add(std::span<const JobEvent> events) {
    for (const JobEvent &event : events) {
      EXPECT_GE(event.time, last_) << "time goes back";
      last_ = event.time;
      if (event.kind == JobEventKind::Released) ++released_[event.task.value];
    }
    watch_.add(events, [this](const metrics::JudgedJob &job) { see(job); });
  }

  void finish(Time end) {
    watch_.finish(end, [this](const metrics::JudgedJob &job) { see(job); });
  }

  void judge(const Workload &workload, const sched::Scheduler &scheduler, Duration length, Figures &figures) const {
    for (const TaskRef &ref : flatten(workload)) {
      const std::size_t t = ref.id.value;
      const sched::Accounting &counted = scheduler.accounting(ref.id);
      EXPECT_EQ(counted.released, released_[t]);
      EXPECT_EQ(counted.finished, finished_[t]);
      EXPECT_EQ(counted.skipped + counted.aborted, lost_[t]);
      if (ref.task->activation == Activation::Timer && ref.task->jitter == 0) {
        const auto grid = static_cast<std::uint64_t>((length - 1 - ref.task->offset) / ref.task->period + 1);
        EXPECT_EQ(counted.released, grid) << "a release of " << ref.task->name << " is missing, or one too many";
      }
      figures.jobs += finished_[t];
      figures.lost += lost_[t];
      compare(slowest_[t], report_.tasks[t].response, figures);
    }
    for (std::size_t d = 0; d < slowest_dag_.size(); ++d) compare(slowest_dag_[d], report_.dags[d].response, figures);
  }

 private:
  void see(const metrics::JudgedJob &job) {
    const std::size_t t = job.record.task.value;
    if (job.miss == metrics::Miss::Lost) ++lost_[t];
    if (job.record.outcome == metrics::JobOutcome::Finished) ++finished_[t];
    if (job.response) slowest_[t] = std::max(slowest_[t], *job.response);
    Duration &dag = slowest_dag_[dag_of_[t]];
    if (job.end_to_end) dag = std::max(dag, *job.end_to_end);
  }

  static void compare(Duration seen, const std::optional<Duration> &bound, Figures &figures) {
    if (!bound) return;
    EXPECT_LE(seen, *bound) << "a job answered later than its bound";
    ++figures.bounded;
    figures.largest_ratio = std::max(figures.largest_ratio, static_cast<double>(seen) / static_cast<double>(*bound));
  }

  const analysis::Report &report_;
  metrics::DeadlineWatch watch_;
  std::vector<std::size_t> dag_of_;  // by TaskId
  std::vector<std::uint64_t> released_, finished_, lost_;
  std::vector<Duration> slowest_;
  std::vector<Duration> slowest_dag_;
  Time last_ = 0;
};

void run_a_day(std::uint64_t seed, Duration length, Figures &figures) {
  const Workload workload = random_task_set(seed);
  if (workload.dags.empty()) return;
  const sched::Config config = sched::config_of(workload);
  const auto task_set = analysis::compile(workload, analysis::platform_of(workload));
  ASSERT_TRUE(task_set) << to_string(task_set.error());
  const analysis::Report report = analysis::analyze(*task_set);
  const auto scheduler = executors::make_scheduler("redag", workload, config);
  Day day(workload, report);

  sim::Options options;
  options.horizon = length;
  options.seed = seed;
  // Counts allocations of the simulator and the scheduler alone: those between one call of the sink and the next.
  std::uint64_t allocations = 0;
  std::uint64_t seen = allocation_count();
  const sim::Result result =
      sim::simulate(workload, *scheduler, config.workers, options, [&](std::span<const JobEvent> events) {
        if (!events.empty() && events.front().time > length / 24) allocations += allocation_count() - seen;
        day.add(events);
        seen = allocation_count();
        return !::testing::Test::HasFailure();
      });
  EXPECT_EQ(allocations, 0U) << "memory is asked for after the first of 24 hours";
  if (!::testing::Test::HasFailure()) {
    day.finish(result.end);
    day.judge(workload, *scheduler, length, figures);
  }
  ++figures.task_sets;
}

TEST(LongRun, NothingWearsOut) {
  const std::optional<std::uint64_t> many = from_environment("REDAG_LONG_RUN");
  const std::uint64_t wanted = many.value_or(24);
  const Duration length = many ? 24 * kHour : 2 * kHour;
  const std::uint64_t first = from_environment("REDAG_LONG_RUN_SEED").value_or(1);
  Figures figures;
  std::uint64_t seed = first;
  for (; figures.task_sets < wanted; ++seed) {
    run_a_day(seed, length, figures);
    ASSERT_FALSE(HasFailure()) << "seed " << seed;
  }
  fmt::print(
      "[ figures  ] {} task sets (seeds {} to {}), {} each: {} jobs finished, {} skipped; {} bounds, largest "
      "observed/bound {:.3f}\n",
      figures.task_sets, first, seed - 1, format_duration(length), figures.jobs, figures.lost, figures.bounded,
      figures.largest_ratio);
  EXPECT_GT(figures.bounded, 0U);
}

}  // namespace
}  // namespace redag::testing
