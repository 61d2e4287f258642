// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/experiment/factorial_recorded.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "redag/model/workload_yaml.hpp"
#include "redag_analysis/metrics/summary.hpp"
#include "redag_analysis/metrics/trace_checker.hpp"
#include "redag_lab/experiment/factorial_results.hpp"
#include "redag_testing/timeline.hpp"

namespace redag::experiment {
namespace {

using ::testing::HasSubstr;

constexpr const char *kWorkload = R"(
      name: cart
      dags:
        - {name: fast, tasks: [{name: sense, wcet: 2ms, bcet: 1ms, period: 10ms}]}
        - {name: slow, tasks: [{name: plan, wcet: 30ms, bcet: 30ms, period: 100ms}]}
)";

FactorialPlan plan() {
  const Result<FactorialPlan> plan = parse_factorial_plan(
      std::string(
          "experiment: factorial\nduration: 1s\nrepetitions: 2\ndemand_scale: [1, 2]\nexecutors: [ideal, redag]\n") +
          "workloads:\n  - name: cart\n    text: |" + kWorkload,
      "plan.yaml", [](World) {
        return std::vector<std::string>{"redag", "mte"};
      });
  EXPECT_TRUE(plan) << (plan ? "" : to_string(plan.error()));
  return plan.value_or(FactorialPlan{});
}

trace::Trace simulated(Workload workload, const std::string &executor, std::uint64_t seed, Duration duration) {
  workload.platform.preemption = PreemptionMode::None;
  return testing::simulated(testing::run_info(std::move(workload), executor, seed), duration);
}

// Returns a run as nodes would record it: with double the demand, on another machine with three workers.
RecordedRun recorded(std::uint64_t seed, Duration duration = kSecond, Duration wcet = 4 * kMillisecond) {
  Workload workload = parse_workload(kWorkload, "cart.yaml")->workload;
  workload.platform.workers = 3;
  workload.dags[0].tasks[0].wcet = wcet;
  workload.dags[0].tasks[0].bcet = wcet / 2;
  workload.dags[1].tasks[0].wcet = workload.dags[1].tasks[0].bcet = 60 * kMillisecond;
  trace::Trace trace = simulated(std::move(workload), "mte", seed, duration);
  trace.info.driver = trace::Driver::RosNodes;
  trace.info.config.workers = 5;  // threads that executed callbacks
  return record("a/events.redag", trace, plan());
}

Result<FinishedRun> drive(const PlannedRun &planned) {
  FinishedRun run;
  run.trace = simulated(planned.workload, planned.executor, planned.seed, planned.duration);
  run.summary = metrics::summarize(run.trace);
  run.check = metrics::check_trace(run.trace, metrics::rules_for(run.trace.info));
  return run;
}

FactorialUnits simulated_units() {
  FactorialUnits units{plan(), {}};
  const Factorial factorial(units.plan, drive);
  for (std::uint64_t unit = 0; unit < factorial.unit_count(); ++unit)
    units.units.push_back({unit, *factorial.evaluate(unit)});
  return units;
}

std::string error_of(const std::vector<RecordedRun> &runs) {
  const Result<FactorialUnits> all = with_recorded({plan(), {}}, runs);
  return all ? "" : to_string(all.error());
}

TEST(Recorded, RunsStandBesideTheSimulators) {
  const FactorialUnits before = simulated_units();
  const std::uint64_t seed_of_first = Factorial(before.plan, drive).planned_run(0)->seed;
  const Result<FactorialUnits> all = with_recorded(before, {recorded(seed_of_first), recorded(77)});
  ASSERT_TRUE(all) << to_string(all.error());
  EXPECT_EQ(all->plan.executors, (std::vector<std::string>{"ideal", "redag", "ros2/mte"}));
  EXPECT_EQ(place_of(all->plan, "ros2/mte").world, World::Ros2);
  EXPECT_EQ(place_of(all->plan, "redag").world, World::Simulator);

  const Factorial factorial(all->plan, drive);
  FactorialCounter counter(factorial);
  for (const FinishedUnit &unit : all->units) ASSERT_TRUE(counter.add(unit.unit, unit.result));
  EXPECT_EQ(counter.results().done, before.units.size() + 2);
  for (const FactorialRow &row : counter.results().rows) {
    const FactorialPoint &point = factorial.points()[row.point];
    const bool is_recorded = all->plan.executors[point.of(FactorKind::Executor)] == "ros2/mte";
    const bool is_double = point.of(FactorKind::DemandScale) == 1;
    ASSERT_EQ(row.repetition.size(), is_recorded && !is_double ? 0U : 2U);
    if (row.repetition.empty()) continue;
    EXPECT_EQ(row.runs()[0].world, is_recorded ? "ros_nodes" : "simulator");
    if (is_recorded) {
      EXPECT_EQ(row.runs()[0].workers, 3U) << "not the threads";
    }
    EXPECT_TRUE(over_runs(factorial, counter.results(), row, 0, Metric::ExcessMissRatio).has_value());
  }
}

// The distance to the ideal compares equal jobs only.
TEST(Recorded, RunsWithOtherJobsHaveNoDistanceToTheIdeal) {
  const Result<FactorialUnits> all = with_recorded(simulated_units(), {recorded(77)});
  ASSERT_TRUE(all) << to_string(all.error());
  const Factorial factorial(all->plan, drive);
  FactorialCounter counter(factorial);
  for (const FinishedUnit &unit : all->units) ASSERT_TRUE(counter.add(unit.unit, unit.result));
  bool found = false;
  for (const FactorialRow &row : counter.results().rows) {
    if (row.repetition.empty() || row.runs()[0].world != "ros_nodes") continue;
    found = true;
    EXPECT_TRUE(over_runs(factorial, counter.results(), row, 0, Metric::MissRatio).has_value());
    EXPECT_FALSE(over_runs(factorial, counter.results(), row, 0, Metric::ExcessMissRatio).has_value());
  }
  EXPECT_TRUE(found);
}

TEST(Recorded, MistakesAreNamed) {
  EXPECT_THAT(error_of({recorded(1), recorded(2), recorded(3)}),
              HasSubstr("there are more runs of 'ros2/mte' than the 2 repetitions"));
  EXPECT_THAT(error_of({recorded(1, 2 * kSecond)}), HasSubstr("its duration is 2s, but 1s in the plan"));
  EXPECT_THAT(error_of({recorded(1, kSecond, 5 * kMillisecond)}),
              HasSubstr("no combination of the plan has the jobs of this run"));
  RecordedRun other = recorded(1);
  other.info.driver = trace::Driver::Threads;
  EXPECT_THAT(error_of({other}), HasSubstr("not a run of ROS 2 nodes"));
}

}  // namespace
}  // namespace redag::experiment
