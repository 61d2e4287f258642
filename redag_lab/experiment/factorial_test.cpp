// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/experiment/factorial.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "redag_analysis/metrics/trace_checker.hpp"
#include "redag_analysis/sim/simulator.hpp"
#include "redag_lab/experiment/factorial_results.hpp"
#include "redag_testing/timeline.hpp"

namespace redag::experiment {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

std::vector<std::string> executors_of(World /*world*/) { return {"redag", "redag-none", "mte", "ste"}; }

FactorialPlan plan_of(const std::string &text) {
  const Result<FactorialPlan> plan = parse_factorial_plan("experiment: factorial\n" + text +
                                                              R"(
workloads:
  - name: cart
    text: |
      name: cart
      platform: {workers: 2, preemption: none}
      dags:
        - {name: fast, max_active: 1, deadline: 20ms, tasks: [
            {name: sense, wcet: 2ms, bcet: 1ms, period: 10ms},
            {name: act, wcet: 2ms, bcet: 1ms, activation: data, after: sense}]}
        - {name: slow, tasks: [{name: plan, wcet: 30ms, bcet: 30ms, period: 100ms}]}
)",
                                                          "plan.yaml", executors_of);
  EXPECT_TRUE(plan) << (plan ? "" : to_string(plan.error()));
  return plan.value_or(FactorialPlan{});
}

// Simulates a run as the program's driver does, without its options.
Result<FinishedRun> simulate_run(const PlannedRun &planned) {
  Workload workload = planned.workload;
  const std::string name = planned.executor.substr(0, planned.executor.find('-'));
  if (name != planned.executor || name != "redag") workload.platform.preemption = PreemptionMode::None;
  sim::Options options;
  options.overheads = planned.overheads;
  FinishedRun run;
  run.trace = testing::simulated(testing::run_info(workload, name, planned.seed), planned.duration, options);
  run.summary = metrics::summarize(run.trace);
  run.check = metrics::check_trace(run.trace, metrics::rules_for(run.trace.info));
  return run;
}

PlannedRun planned(const Factorial &factorial, std::uint64_t unit) {
  const Result<PlannedRun> run = factorial.planned_run(unit);
  EXPECT_TRUE(run) << (run ? "" : to_string(run.error()));
  return run.value_or(PlannedRun{});
}

FactorialResults run_all(const Factorial &factorial) {
  FactorialCounter counter(factorial);
  for (std::uint64_t unit = 0; unit < factorial.unit_count(); ++unit) {
    const Result<std::string> result = factorial.evaluate(unit);
    EXPECT_TRUE(result) << to_string(result.error());
    EXPECT_EQ(result->find('\n'), std::string::npos);
    EXPECT_TRUE(counter.add(unit, *result));
  }
  return counter.results();
}

std::string observations_of(const Factorial &factorial, const FactorialResults &results) {
  std::string text;
  observations_csv(factorial, results, [&text](std::string_view piece) { text += piece; });
  return text;
}

TEST(Factorial, WorkloadsAreAsThePointSays) {
  const Factorial factorial(plan_of("workers: [1, 3]\ndemand_scale: [2]\ndeadline_scale: [0.5]\nmax_active: [[3, 0]]\n"
                                    "policies: [edf]\nexecutors: [redag]"),
                            simulate_run);
  ASSERT_EQ(factorial.unit_count(), 2U);
  const Workload workload = planned(factorial, 1).workload;
  EXPECT_EQ(workload.platform.workers, 3U);
  EXPECT_EQ(workload.policy, PolicyKind::Edf);
  EXPECT_EQ(workload.dags[0].max_active, 3U);
  EXPECT_EQ(workload.dags[1].max_active, 0U);
  EXPECT_EQ(workload.dags[0].deadline, 10 * kMillisecond);
  EXPECT_EQ(workload.dags[0].tasks[1].wcet, 4 * kMillisecond);
  EXPECT_EQ(workload.dags[0].tasks[1].bcet, 2 * kMillisecond);
  EXPECT_EQ(workload.dags[0].tasks[1].deadline, 5 * kMillisecond);
  EXPECT_EQ(workload.dags[0].tasks[0].period, 10 * kMillisecond);
}

TEST(Factorial, UtilizationIsPerWorkerAndOfMeanExecutionTimes) {
  const Factorial factorial(plan_of("workers: [1, 4]\nutilization: [0.3, 1.5]\nexecutors: [redag]"), simulate_run);
  for (std::uint64_t unit = 0; unit < factorial.unit_count(); ++unit) {
    const FactorialPoint &point = factorial.points()[unit];
    const double wanted =
        (point.of(FactorKind::Workers) == 0 ? 1 : 4) * (point.of(FactorKind::Utilization) == 0 ? 0.3 : 1.5);
    EXPECT_NEAR(mean_utilization(planned(factorial, unit).workload), wanted, 1e-5);
  }
}

TEST(Factorial, IdealHasNoBoundsAndNoOverheads) {
  const Factorial factorial(
      plan_of("overheads: {dispatch: 1ms}\nworld: threads\nexecutors: [ideal, unlimited, redag-none]"), simulate_run);
  const PlannedRun ideal = planned(factorial, 0);
  EXPECT_EQ(ideal.executor, "redag");
  EXPECT_EQ(ideal.world, World::Simulator);
  EXPECT_EQ(ideal.workload.platform.preemption, PreemptionMode::Os);
  EXPECT_EQ(ideal.workload.dags[0].max_active, 0U);
  EXPECT_EQ(ideal.overheads.dispatch, 0);
  EXPECT_EQ(planned(factorial, 1).workload.platform.workers, 3U);
  const PlannedRun none = planned(factorial, 2);
  EXPECT_EQ(none.world, World::Threads);
  EXPECT_EQ(none.overheads.dispatch, kMillisecond);
  EXPECT_EQ(none.workload.dags[0].max_active, 1U);
}

// "plan" of the DAG "slow" takes 30 ms, ten times a second.
TEST(Factorial, ThroughputIsOfTheTimeThatCounts) {
  const Factorial factorial(plan_of("duration: 2s\nrepetitions: 1\nexecutors: [redag]"), simulate_run);
  const FactorialResults results = run_all(factorial);
  const auto of_slow = [&](Metric metric) { return over_runs(factorial, results, results.rows[0], 1, metric)->median; };
  EXPECT_DOUBLE_EQ(of_slow(Metric::FinishedPerSecond), 10);
  EXPECT_DOUBLE_EQ(of_slow(Metric::Work), 0.3);
}

TEST(Factorial, RepetitionsHaveTheirOwnJobsTheSameForEveryExecutor) {
  const Factorial factorial(plan_of("repetitions: 2\nexecutors: [redag, mte]\nutilization: [0.5]\n"), simulate_run);
  EXPECT_EQ(planned(factorial, 0).seed, planned(factorial, 1).seed);
  EXPECT_NE(planned(factorial, 0).seed, planned(factorial, 2).seed);
}

TEST(Factorial, RandomWorkloadsAreDrawnByRepetition) {
  FactorialPlan plan = plan_of("repetitions: 2\nexecutors: [redag, mte]\nutilization: [0.5, 0.9]\nworkers: 2\n");
  plan.workloads = {WorkloadSource{"drawn", {}, lab::GenerateOptions{}}};
  const Factorial factorial(plan, simulate_run);
  EXPECT_EQ(planned(factorial, 0).workload, planned(factorial, 1).workload);
  EXPECT_NE(planned(factorial, 0).workload, planned(factorial, 4).workload);
  EXPECT_NEAR(mean_utilization(planned(factorial, 3).workload), 1.8, 1e-5);
  // Another load scales the same tasks.
  EXPECT_EQ(planned(factorial, 0).workload.dags[0].tasks[0].period,
            planned(factorial, 2).workload.dags[0].tasks[0].period);
}

TEST(Factorial, ResultsAreMediansWithTheirDistanceToTheIdeal) {
  const Factorial factorial(plan_of("repetitions: 7\nduration: 2s\nquantiles: true\nworkers: [1, 2]\n"
                                    "executors: [unlimited, ideal, redag-none, ste]"),
                            simulate_run);
  const FactorialResults results = run_all(factorial);
  EXPECT_TRUE(results.complete());
  EXPECT_EQ(results.violations, 0U);
  EXPECT_GT(results.checks, 1000U);
  EXPECT_EQ(results.unenforced, 0U);
  const auto miss = [&](const char *executor, std::uint32_t workers, Metric metric) {
    for (const FactorialRow &row : results.rows) {
      const FactorialPoint &point = factorial.points()[row.point];
      if (factorial.plan().executors[point.of(FactorKind::Executor)] != executor) continue;
      if (point.of(FactorKind::Workers) != kNoLevel && point.of(FactorKind::Workers) != workers) continue;
      const std::optional<Median> median = over_runs(factorial, results, row, 2, metric);
      return median ? median->median : -1.0;
    }
    return -2.0;
  };
  EXPECT_EQ(miss("ideal", 0, Metric::MissRatio), 0);
  EXPECT_EQ(miss("unlimited", 0, Metric::MissRatio), 0);
  // The 30 ms of `plan` block the 10 ms of `sense` on one worker: two or three of ten releases miss.
  EXPECT_GT(miss("redag-none", 0, Metric::MissRatio), 0.05);
  EXPECT_EQ(miss("redag-none", 1, Metric::MissRatio), 0);
  EXPECT_EQ(miss("redag-none", 0, Metric::ExcessMissRatio), miss("redag-none", 0, Metric::MissRatio));
  EXPECT_EQ(miss("ste", 0, Metric::ExcessMissRatio), -1);  // ste has one worker at every level, which matches no ideal
  EXPECT_GT(miss("ste", 0, Metric::PaperMissRatio), miss("ste", 0, Metric::LateRatio));

  const std::string csv = to_csv(factorial, results);
  EXPECT_THAT(csv, HasSubstr("workload,policy,workers,utilization,demand_scale,deadline_scale,max_active,executor,"));
  EXPECT_THAT(csv, HasSubstr("\ncart,,1,,,,,redag-none,simulator,none,total,7,0.9844,"));
  EXPECT_THAT(observations_of(factorial, results), HasSubstr("\ncart,,,,,,,ste,6,"));
  EXPECT_THAT(quantiles_csv(factorial, results), HasSubstr("cart,,2,,,,,ideal,slow,100,30000000\n"));
  const std::string json = to_json(factorial, results, {});
  EXPECT_THAT(json, HasSubstr("\"format\":\"redag.experiment.factorial/2\""));
  EXPECT_THAT(json, HasSubstr("\"complete\":true"));
  EXPECT_THAT(to_svg(factorial, results), HasSubstr("workers"));
  EXPECT_THAT(responses_svg(factorial, results), HasSubstr(">cart, workers 2: slow<"));

  const std::vector<FactorialEffects> effects = effects_of(factorial, results);
  ASSERT_EQ(effects.size(), 2U);  // ideal and redag-none; the number of workers does not affect the others
  EXPECT_GT(effects[1].effects.terms[0].share, 0.9);
}

TEST(Factorial, TheDistanceToTheIdealHasAPanelForEachNumberOfWorkers) {
  const auto plot = [](const std::string &keys) {
    const Factorial factorial(plan_of("duration: 1s\n" + keys), simulate_run);
    return distance_svg(factorial, run_all(factorial));
  };
  const std::optional<std::string> svg =
      plot("utilization: [0.5, 1.5]\nworkers: [1, 2]\nexecutors: [ideal, redag-none, ste]");
  ASSERT_TRUE(svg);
  EXPECT_THAT(*svg, AllOf(HasSubstr(">cart, workers 1<"), HasSubstr(">cart, workers 2<"), HasSubstr(">ste<")));
  EXPECT_THAT(*svg, Not(HasSubstr(">ideal<")));
  EXPECT_EQ(plot("utilization: [0.5, 1.5]\nexecutors: [redag, ste]"), std::nullopt) << "there is no ideal";
  EXPECT_EQ(plot("executors: [ideal, ste]"), std::nullopt) << "nothing for the axis";
}

TEST(Factorial, UnfinishedResultsSayWhatTheyCan) {
  const Factorial factorial(plan_of("repetitions: 2\nduration: 1s\nexecutors: [ideal, mte]"), simulate_run);
  FactorialCounter counter(factorial);
  EXPECT_TRUE(counter.add(1, *factorial.evaluate(1)));
  const FactorialResults &results = counter.results();
  EXPECT_FALSE(results.complete());
  EXPECT_EQ(over_runs(factorial, results, results.rows[1], 0, Metric::MissRatio)->confidence, 0);
  EXPECT_EQ(over_runs(factorial, results, results.rows[1], 0, Metric::ExcessMissRatio), std::nullopt);
  EXPECT_EQ(over_runs(factorial, results, results.rows[0], 0, Metric::MissRatio), std::nullopt);
  EXPECT_TRUE(effects_of(factorial, results).empty());
  EXPECT_THAT(to_svg(factorial, results), HasSubstr("1 of 4 runs are done"));
  EXPECT_FALSE(counter.add(4, *factorial.evaluate(1)));
  EXPECT_FALSE(counter.add(2, "[1,2]"));
  EXPECT_FALSE(counter.add(2, "x"));
}

TEST(Observation, TextGivesItBack) {
  const Factorial factorial(plan_of("duration: 1s\nquantiles: true\nexecutors: [ste]"), simulate_run);
  const Result<std::string> line = factorial.evaluate(0);
  ASSERT_TRUE(line);
  const Result<Observation> seen = parse_observation(*line);
  ASSERT_TRUE(seen) << to_string(seen.error());
  EXPECT_EQ(to_line(*seen), *line);
  EXPECT_EQ(seen->dags.back().dag, "total");
  EXPECT_EQ(seen->dags.back().of(Measure::Released),
            seen->dags[0].of(Measure::Released) + seen->dags[1].of(Measure::Released));
  EXPECT_EQ(seen->dags[0].quantiles.back(), seen->dags[0].of(Measure::ResponseMax));
  EXPECT_EQ(seen->dags.back().of(Measure::ResponseMax), kNotMeasured);
  EXPECT_TRUE(seen->dags.back().quantiles.empty()) << "of several DAGs";
  EXPECT_EQ(seen->workers, 1U);
}

// Two runs of one combination: the DAG `slow` responds within 20 and 30 ms, and misses 0 and 10 of 100.
TEST(Factorial, MaximaAreOfAllRunsAndAllDagsTogetherHaveNoResponse) {
  const Factorial factorial(plan_of("duration: 1s\nrepetitions: 3\nexecutors: [redag]"), simulate_run);
  FactorialCounter counter(factorial);
  for (std::uint64_t unit = 0; unit < factorial.unit_count(); ++unit) {
    Observation seen = *parse_observation(*factorial.evaluate(unit));
    for (const Measure measure : {Measure::ResponseMax, Measure::MaxLateness, Measure::PeakActive}) {
      seen.dags[1].values[static_cast<std::size_t>(measure)] = unit == 1 ? 30 : 20;
    }
    seen.dags[1].values[static_cast<std::size_t>(Measure::ResponseP99)] = unit == 1 ? 30 : 20;
    if (unit == 2) seen.dags[1].values[static_cast<std::size_t>(Measure::ResponseMean)] = kNotMeasured;
    ASSERT_TRUE(counter.add(unit, to_line(seen)));
  }
  const FactorialRow &row = counter.results().rows[0];
  const auto of_slow = [&](Metric metric) { return *over_runs(factorial, counter.results(), row, 1, metric); };
  for (const Metric metric : {Metric::ResponseMax, Metric::MaxLateness, Metric::PeakActive}) {
    EXPECT_EQ(of_slow(metric).median, 30) << to_string(metric);
    EXPECT_EQ(of_slow(metric).low, 20);
    EXPECT_EQ(of_slow(metric).high, 30);
  }
  EXPECT_EQ(of_slow(Metric::ResponseP99).median, 20) << "of a percentile the median of the runs";
  EXPECT_GT(of_slow(Metric::ResponseMean).low, 0) << "a run that did not answer is no answer after 0 ns";
  EXPECT_EQ(over_runs(factorial, counter.results(), row, 2, Metric::ResponseP99), std::nullopt) << "of all DAGs";
  EXPECT_THAT(observations_of(factorial, counter.results()), ::testing::Not(HasSubstr("-9223372036854775808")));
}

TEST(Factorial, MistakesNameTheCombination) {
  const Factorial factorial(plan_of("workers: [5000]\nexecutors: [redag]"), simulate_run);
  const Result<std::string> result = factorial.evaluate(0);
  ASSERT_FALSE(result);
  EXPECT_THAT(to_string(result.error()), HasSubstr("(workload cart, workers 5000, executor redag)"));
}

}  // namespace
}  // namespace redag::experiment
