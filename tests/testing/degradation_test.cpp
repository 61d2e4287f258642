// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// A degraded DAG stays in step: HI mode lets through the same periods of all tasks that edges join, whichever release
// each saw first. The tests run on the scheduler and on the reference scheduler, because both could share a mistake.
#include <algorithm>
#include <cmath>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "redag/derived/rng.hpp"
#include "redag/sched/degradation.hpp"
#include "redag/sched/priority_scheduler.hpp"
#include "tests/testing/builders.hpp"
#include "tests/testing/reference_scheduler.hpp"
#include "tests/testing/timeline.hpp"

namespace redag::testing {
namespace {

using sched::kNoRelease;
using sched::lets_through;

constexpr Degrade skip(std::uint32_t releases) { return Degrade{Degrade::Kind::Skip, releases, 2}; }
constexpr Degrade stretch(double factor) { return Degrade{Degrade::Kind::Stretch, 1, factor}; }

// Of the releases at 0, 10, 20, ... those that are let through.
std::vector<Time> on_a_grid(const Degrade &degrade) {
  std::vector<Time> taken;
  for (Time release = 0; release <= 60; release += 10) {
    if (lets_through(degrade, 10, taken.empty() ? kNoRelease : taken.back(), release)) taken.push_back(release);
  }
  return taken;
}

TEST(LetsThrough, CountsPeriods) {
  EXPECT_EQ(on_a_grid(Degrade{}), std::vector<Time>{});
  EXPECT_EQ(on_a_grid(skip(1)), (std::vector<Time>{0, 20, 40, 60}));
  EXPECT_EQ(on_a_grid(skip(2)), (std::vector<Time>{0, 30, 60}));
  EXPECT_EQ(on_a_grid(stretch(1)), (std::vector<Time>{0, 10, 20, 30, 40, 50, 60}));
  EXPECT_EQ(on_a_grid(stretch(1.5)), (std::vector<Time>{0, 20, 40, 60}));
  EXPECT_EQ(on_a_grid(stretch(2.1)), (std::vector<Time>{0, 30, 60}));
}

TEST(LetsThrough, OfNoGridWhatIsAboutAsManyPeriodsLater) {
  EXPECT_TRUE(lets_through(skip(1), 10, 0, 16));
  EXPECT_FALSE(lets_through(skip(1), 10, 0, 15));
  EXPECT_TRUE(lets_through(stretch(1.5), 10, 0, 15));
  EXPECT_FALSE(lets_through(stretch(1.5), 10, 0, 14));
}

TEST(LetsThrough, ChoosesTheSameWhoeverAsksLater) {
  EXPECT_TRUE(lets_through(skip(2), 10, 60, 60));
  EXPECT_FALSE(lets_through(skip(2), 10, 60, 50));
  EXPECT_FALSE(lets_through(skip(2), 10, 60, 40));
  EXPECT_TRUE(lets_through(skip(2), 10, 60, 30));
  EXPECT_TRUE(lets_through(stretch(1.5), 10, 60, 40));
}

TEST(LetsThrough, IsRightAtTheEndOfTime) {
  EXPECT_FALSE(lets_through(skip(1'000'000), kMaxDuration, -kMaxDuration, kMaxDuration));
  EXPECT_FALSE(lets_through(stretch(1e6), kMaxDuration, -kMaxDuration, kMaxDuration));
  EXPECT_TRUE(lets_through(stretch(1.9), kMaxDuration, -kMaxDuration, kMaxDuration));
}

enum class Which : std::uint8_t { Ours, Reference };

std::unique_ptr<sched::Scheduler> make(Which which, const Workload &workload) {
  const sched::Config config{workload.platform.workers, sched::Preemption::None, workload.policy};
  if (which == Which::Ours) return std::make_unique<sched::PriorityScheduler>(workload, config);
  return std::make_unique<ReferenceScheduler>(workload, config);
}

// Task 0 is of high criticality and keeps a worker while HI mode is on. The others belong to a DAG that skips every
// second period, and end as soon as they begin. Times are in milliseconds.
class Degradation : public ::testing::TestWithParam<Which> {
 public:
  void begin(const std::vector<TestTask> &tasks) {
    Workload workload = make_workload({make_dag("hi", {{"h", 1000, 900}}), make_dag("lo", tasks)}, 3);
    workload.dags[0].criticality = Criticality::High;
    workload.dags[1].degrade = skip(1);
    names_ = {"h"};
    for (const TestTask &task : tasks) names_.push_back(task.name);
    scheduler = make(GetParam(), workload);
  }
  void high_mode_begins(Time now) {
    scheduler->release(TaskId(0), now * kMillisecond, now * kMillisecond);
    high_ = decide(now);
    scheduler->exceed(high_, sched::Limit::WcetLow, now * kMillisecond);
    decide(now);
    EXPECT_TRUE(scheduler->high_mode());
  }
  void high_mode_ends(Time now) {
    scheduler->complete(high_, now * kMillisecond, sched::Outcome::Finished);
    decide(now);
    EXPECT_FALSE(scheduler->high_mode());
  }
  void release(std::uint32_t task, Time nominal, Time seen) {
    scheduler->release(TaskId(task), nominal * kMillisecond, seen * kMillisecond);
    decide(seen);
    decide(seen);  // jobs that the completion made ready
  }

  std::string ended;  // " a10": the job of a that was released at 10
  std::unique_ptr<sched::Scheduler> scheduler;

 private:
  JobSlot decide(Time now) {
    const sched::Step step = scheduler->dispatch(now * kMillisecond);
    const std::vector<sched::Dispatch> begun(step.dispatches.begin(), step.dispatches.end());
    JobSlot high;
    for (const sched::Dispatch &dispatch : begun) {
      if (dispatch.task == TaskId(0)) {
        high = dispatch.job;
        continue;
      }
      ended += " " + names_[dispatch.task.value] + std::to_string(dispatch.release / kMillisecond);
      scheduler->complete(dispatch.job, now * kMillisecond, sched::Outcome::Finished);
    }
    return high;
  }

  JobSlot high_;
  std::vector<std::string> names_;
};

// The source's release of 10 is seen before HI mode begins, and the sink's after it. Counting alone, each task would
// continue with every second release that it sees: the source at 20 and 40, the sink at 10 and 30. No job of the sink
// would have data.
TEST_P(Degradation, TasksThatSawDifferentReleasesFirstStayInStep) {
  begin({{"a", 10}, {"b", 10, 1, {0}}});
  release(1, 10, 10);
  high_mode_begins(11);
  for (Time period = 10; period <= 60; period += 10) {
    if (period > 10) release(1, period, period);
    release(2, period, period + 3);
  }
  EXPECT_EQ(ended, " a10 b10 a30 b30 a50 b50");
}

TEST_P(Degradation, ATaskOfAnotherOffsetCountsByItself) {
  begin({{"a", 10}, {"b", 10, 1, {0}, "", 5}});
  release(1, 10, 10);
  high_mode_begins(11);
  for (Time period = 10; period <= 40; period += 10) {
    if (period > 10) release(1, period, period);
    release(2, period + 5, period + 5);
  }
  EXPECT_EQ(ended, " a10 b15 a20 b35 a40");
}

TEST_P(Degradation, ATaskWithoutEdgesCountsByItself) {
  begin({{"a", 10}, {"b", 10, 1, {0}}, {"c", 10}, {"d", 10}});
  for (const std::uint32_t task : {1U, 2U, 4U}) release(task, 10, 10);
  high_mode_begins(11);
  release(3, 10, 12);
  for (Time period = 20; period <= 40; period += 10) {
    for (const std::uint32_t task : {1U, 2U, 3U, 4U}) release(task, period, period);
  }
  EXPECT_EQ(ended, " a10 b10 d10 c10 a20 b20 d20 c30 a40 b40 d40");
}

TEST_P(Degradation, EveryHighModeCountsAnew) {
  begin({{"a", 10}});
  high_mode_begins(5);
  release(1, 10, 10);
  high_mode_ends(11);
  high_mode_begins(15);
  release(1, 20, 20);
  release(1, 30, 30);
  EXPECT_EQ(ended, " a10 a20");
}

// A random DAG of 2 to 5 tasks on one grid, all joined by edges. Apart from random_dag(), which draws tasks of
// different periods: the property is about tasks that are let through together.
Dag random_joined_dag(Rng &rng) {
  std::vector<TestTask> tasks;
  const auto count = static_cast<std::uint32_t>(rng.uniform(2, 5));
  for (std::uint32_t i = 0; i < count; ++i) {
    tasks.push_back({"t" + std::to_string(i), 10, 1});
    if (i > 0) tasks.back().after.push_back(static_cast<std::uint32_t>(rng.uniform(0, i - 1)));
  }
  Dag dag = make_dag("lo", tasks);
  for (Task &task : dag.tasks) task.jitter = rng.uniform(0, 10 * kMillisecond);
  dag.degrade =
      rng.uniform01() < 0.5 ? skip(static_cast<std::uint32_t>(rng.uniform(1, 3))) : stretch(1 + 3 * rng.uniform01());
  return dag;
}

Duration cycle_of(const Dag &dag) {
  const bool skips = dag.degrade.kind == Degrade::Kind::Skip;
  return 10 * kMillisecond * (skips ? dag.degrade.skip + 1 : static_cast<Duration>(std::ceil(dag.degrade.stretch)));
}

// HI mode lasts from some instant to the end. One worker serves its cause, and there are enough for the other tasks.
TEST(DegradationProperty, JoinedTasksAreLetThroughInTheSamePeriodsAndNoneStarves) {
  for (std::uint64_t seed = 1; seed <= 500; ++seed) {
    Rng rng(seed);
    Workload workload = make_workload({make_dag("hi", {{"h", 2000, 1990}}), random_joined_dag(rng)}, 8);
    workload.dags[0].criticality = Criticality::High;
    workload.dags[0].tasks[0].wcet_low = rng.uniform(kMillisecond, 60 * kMillisecond);
    const Duration cycle = cycle_of(workload.dags[1]);
    sim::Options options;
    options.seed = seed;
    std::map<TaskId, std::set<std::uint32_t>> released;
    std::map<TaskId, std::set<std::uint32_t>> refused;
    std::map<TaskId, std::size_t> finished;
    bool high = false;
    for (const JobEvent &event : simulate_events(workload, kSecond, options)) {
      high = high || event.kind == JobEventKind::HighMode;
      if (!high || event.task == TaskId(0)) continue;
      if (event.kind == JobEventKind::Released) released[event.task].insert(event.job);
      if (event.kind == JobEventKind::Skipped && event.reason == Reason::Degraded)
        refused[event.task].insert(event.job);
      if (event.kind == JobEventKind::Finished) ++finished[event.task];
    }
    ASSERT_EQ(released.size(), workload.dags[1].tasks.size()) << "seed " << seed;
    std::optional<Duration> phase;
    for (const auto &[task, jobs] : released) {
      std::size_t taken = 0;
      for (const std::uint32_t job : jobs) {
        if (refused[task].count(job) != 0) continue;
        ++taken;
        const Duration its_phase = job * 10 * kMillisecond % cycle;
        ASSERT_EQ(its_phase, phase.value_or(its_phase)) << "seed " << seed << " task " << task.value << " job " << job;
        phase = its_phase;
      }
      ASSERT_GE(taken, static_cast<std::size_t>(9 * kSecond / 10 / cycle)) << "seed " << seed;
      if (cycle == 10 * kMillisecond)
        continue;  // the next release can come before the data, and is then skipped as in
                   // LO mode
      ASSERT_GE(finished[task] + 3, taken) << "seed " << seed << " task " << task.value;
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Schedulers, Degradation, ::testing::Values(Which::Ours, Which::Reference),
                         [](const auto &instance) {
                           return std::string(instance.param == Which::Ours ? "Ours" : "Reference");
                         });

}  // namespace
}  // namespace redag::testing
