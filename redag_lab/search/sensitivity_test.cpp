// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/search/sensitivity.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "redag/loader/validate.hpp"
#include "redag/sched/priority_scheduler.hpp"
#include "redag_analysis/sim/simulator.hpp"
#include "tests/testing/bound_property.hpp"
#include "tests/testing/builders.hpp"

namespace redag::lab {
namespace {

using Kind = Knob::Kind;
using testing::BoundCase;
using testing::BoundCaseLimits;
using testing::independent;

std::vector<std::uint32_t> all_tasks(const Workload &workload) {
  std::vector<std::uint32_t> all;
  for (const TaskRef &ref : flatten(workload)) all.push_back(ref.id.value);
  return all;
}

Margin margin(const Workload &workload, const Knob &knob) {
  return margin_of(workload, analysis::platform_of(workload), knob).value();
}

Margin all_wcets(const Workload &workload) { return margin(workload, {Kind::AllWcets, all_tasks(workload)}); }

TEST(Sensitivity, HarmonicPeriodsUseTheWholeWorker) {
  // U = 1/4 + 1/8 + 1/8 = 1/2. With rate-monotonic priorities, harmonic periods reach U = 1.
  const Workload half = independent(
      {{kMillisecond, 4 * kMillisecond}, {kMillisecond, 8 * kMillisecond}, {2 * kMillisecond, 16 * kMillisecond}});
  const Margin found = all_wcets(half);
  EXPECT_EQ(found.position, 2 * kFactorUnit);
  EXPECT_DOUBLE_EQ(found.factor, 2.0);
  EXPECT_EQ(found.obstacle, "the utilization exceeds 1");
  // One task takes all the remaining time: 1 ms + 1/2 of 8 ms.
  EXPECT_EQ(margin(half, {Kind::Wcet, {1}}).position, 5 * kMillisecond);
}

TEST(Sensitivity, TheLargestLoadOfTwoTasksOfLiuAndLayland) {
  // With T2 / T1 = sqrt(2), C1 = T2 - T1 and C2 = 2 T1 - T2 fill the worker at U = 2 (sqrt(2) - 1) = 0.828. Not one
  // more nanosecond fits. Halved wcets leave a factor of 2.
  const Duration first = 1'000'000'000;
  const Duration second = 1'414'213'562;
  const Workload full = independent({{second - first, first}, {2 * first - second, second}});
  const Margin exact = margin(full, {Kind::Wcet, {0}});
  EXPECT_EQ(exact.position, exact.nominal);
  EXPECT_EQ(margin(full, {Kind::Wcet, {1}}).position, 2 * first - second);
  EXPECT_EQ(all_wcets(full).position, kFactorUnit);
  const Workload half = independent({{(second - first) / 2, first}, {(2 * first - second) / 2, second}});
  EXPECT_EQ(all_wcets(half).position, 2 * kFactorUnit);
}

TEST(Sensitivity, AnOverloadedWorkloadHasToShrink) {
  // Harmonic periods, U = 1/2 + 3/4. All fit when scaled by 4/5, and each task alone has to give up 1/4.
  const Workload heavy = independent({{4000, 8000}, {12000, 16000}});
  const Margin all = all_wcets(heavy);
  ASSERT_TRUE(all.position);
  EXPECT_LT(all.factor, 1.0);
  EXPECT_EQ(all.position, 800'000);
  EXPECT_EQ(margin(heavy, {Kind::Wcet, {0}}).position, 2000);
  EXPECT_EQ(margin(heavy, {Kind::Wcet, {1}}).position, 8000);
  // Wcets are rounded up to whole nanoseconds. Small ones therefore leave less: 4 and 10 do not fit, 3 and 9 do.
  EXPECT_EQ(all_wcets(independent({{4, 8}, {12, 16}})).position, 750'000);
}

TEST(Sensitivity, WhereNoneAloneSufficesItSaysSo) {
  const Workload hopeless = independent({{9, 8}, {17, 16}});
  EXPECT_FALSE(margin(hopeless, {Kind::Wcet, {0}}).position);
  EXPECT_FALSE(margin(hopeless, {Kind::Wcet, {1}}).position);
  EXPECT_EQ(margin(hopeless, {Kind::Wcet, {0}}).obstacle, "b.t alone takes longer than its deadline allows");
  EXPECT_TRUE(all_wcets(hopeless).position);
}

TEST(Sensitivity, StopsWhenAsked) {
  const Workload workload = independent({{kMillisecond, 4 * kMillisecond}});
  SensitivityOptions options;
  int asked = 0;
  options.stop = [&] { return ++asked > 5; };
  EXPECT_FALSE(margin_of(workload, analysis::platform_of(workload), {Kind::Wcet, {0}}, accepted_by_analysis, options));
}

TEST(Sensitivity, KnobsAreThoseOfAllTasksAndOfEach) {
  const std::vector<Knob> expected = {{Kind::AllWcets, {0, 1}}, {Kind::Wcet, {0}}, {Kind::Wcet, {1}}};
  EXPECT_EQ(knobs_of(independent({{1, 10}, {1, 20}})), expected);
}

// True if no deadline is missed and no job skipped when all tasks start together and run for their wcet.
bool simulated_without_a_miss(const BoundCase &bound_case, const Workload &workload) {
  const sched::Config config = analysis::config_of(bound_case.platform, workload);
  sched::PriorityScheduler scheduler(workload, config);
  sim::Options options;
  Duration longest = 0;
  std::vector<Duration> deadlines;
  for (const TaskRef &ref : flatten(workload)) {
    longest = std::max(longest, ref.task->period);
    deadlines.push_back(ref.task->deadline);
  }
  options.horizon = 6 * longest;
  options.demand = [](const Task &task, TaskId, std::uint32_t) { return task.wcet; };
  std::vector<std::vector<Time>> releases(deadlines.size());
  bool ok = true;
  sim::simulate(workload, scheduler, config.workers, options, [&](std::span<const JobEvent> events) {
    for (const JobEvent &event : events) {
      std::vector<Time> &own = releases[event.task.value];
      if (event.kind == JobEventKind::Released) {
        if (own.size() <= event.job) own.resize(event.job + 1);
        own[event.job] = event.value;
      }
      if (event.kind == JobEventKind::Skipped || event.kind == JobEventKind::Aborted) ok = false;
      if (event.kind == JobEventKind::Finished) {
        ok = ok && event.value - own.at(event.job) <= deadlines[event.task.value];
      }
    }
    return ok;
  });
  return ok;
}

// Checks that the found position is accepted, the next one is not, and a simulation at the found position misses
// nothing.
void expect_consistent(const BoundCaseLimits &limits) {
  const auto cases = static_cast<int>(testing::how_many(200));
  int found_some = 0;
  for (int i = 0; i < cases; ++i) {
    Rng rng(mix(static_cast<std::uint64_t>(i) + 77));
    const BoundCase bound_case = testing::random_bound_case(rng, limits);
    SCOPED_TRACE(describe(bound_case));
    const auto task_set = analysis::compile(bound_case.workload, bound_case.platform);
    ASSERT_TRUE(task_set);
    const bool nominal = analysis::analyze(*task_set).verdict == analysis::Verdict::Schedulable;
    EXPECT_EQ(analysis::is_shown_schedulable(*task_set), nominal);
    for (const Knob &knob : knobs_of(bound_case.workload)) {
      const auto result = margin_of(bound_case.workload, bound_case.platform, knob, accepted_by_analysis, {4, {}});
      ASSERT_TRUE(result);
      if (!result->position) {
        EXPECT_FALSE(nominal);
        continue;
      }
      ++found_some;
      EXPECT_EQ(*result->position >= result->nominal, nominal);
      EXPECT_EQ(result->factor >= 1.0, nominal);
      const Workload at = turned(bound_case.workload, knob, *result->position);
      EXPECT_TRUE(validate(at).empty() || !has_errors(validate(at)));
      EXPECT_EQ(analysis::analyze(analysis::compile(at, bound_case.platform).value()).verdict,
                analysis::Verdict::Schedulable);
      EXPECT_TRUE(simulated_without_a_miss(bound_case, at));
      // A random position between was not tested, but must hold too. Bounds cover shorter executions.
      if (nominal) {
        const std::int64_t between = rng.uniform(result->nominal, *result->position);
        EXPECT_TRUE(simulated_without_a_miss(bound_case, turned(bound_case.workload, knob, between))) << between;
      }
      const auto beyond =
          analysis::compile(turned(bound_case.workload, knob, *result->position + 1), bound_case.platform);
      EXPECT_TRUE(!beyond || analysis::analyze(*beyond).verdict == analysis::Verdict::NotShown);
    }
    if (::testing::Test::HasFailure()) return;
  }
  EXPECT_GT(found_some, cases);
}

TEST(SensitivityProperty, OneWorker) {
  BoundCaseLimits limits;
  limits.groups = true;
  expect_consistent(limits);
}

TEST(SensitivityProperty, SeveralWorkersAndDags) {
  BoundCaseLimits limits;
  limits.min_workers = 2;
  limits.max_workers = 3;
  limits.edges = limits.caps = true;
  limits.max_dags = 3;
  expect_consistent(limits);
}

TEST(SensitivityProperty, RunToCompletion) {
  BoundCaseLimits limits;
  limits.max_workers = 2;
  limits.preemption = sched::Preemption::None;
  limits.max_utilization = 1.3;
  expect_consistent(limits);
}

TEST(Scaling, KeepsAWorkloadValid) {
  Workload workload = independent({{10, 100}});
  Task &task = workload.dags[0].tasks[0];
  task.bcet = 4;
  task.region = 3;
  task.execution = {ExecutionTime::Kind::Empirical, 0, 0, {4, 7, 10}};
  for (const std::int64_t wcet : {1, 3, 9, 10, 11, 77}) {
    const Workload changed = turned(workload, {Kind::Wcet, {0}}, wcet);
    EXPECT_FALSE(has_errors(validate(changed))) << wcet;
    EXPECT_EQ(changed.dags[0].tasks[0].wcet, wcet);
  }
  const Workload doubled = turned(workload, {Kind::AllWcets, {0}}, 2 * kFactorUnit);
  EXPECT_EQ(doubled.dags[0].tasks[0].execution.samples, (std::vector<Duration>{8, 14, 20}));
  EXPECT_EQ(doubled.dags[0].tasks[0].region, 6);
  EXPECT_EQ(turned(workload, {Kind::AllWcets, {0}}, kFactorUnit), workload);
}

}  // namespace
}  // namespace redag::lab
