// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/experiment/factorial.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>

#include "redag_analysis/metrics/check/trace_checker.hpp"
#include "redag_analysis/sim/simulator.hpp"
#include "tests/testing/timeline.hpp"

namespace redag::experiment {
namespace {

using ::testing::HasSubstr;

std::vector<std::string> executors_of(World /*world*/) { return {"redag", "redag-none", "mte", "ste"}; }

constexpr const char *kCart = R"(
name: cart
platform: {workers: 2, preemption: none}
dags:
  - {name: fast, max_active: 1, deadline: 20ms, tasks: [
      {name: sense, wcet: 2ms, bcet: 1ms, period: 10ms},
      {name: act, wcet: 2ms, bcet: 1ms, activation: data, after: sense}]}
  - {name: slow, tasks: [{name: plan, wcet: 30ms, bcet: 30ms, period: 100ms}]}
)";

FactorialPlan plan_of(const std::string &text) {
  const std::filesystem::path file =
      std::filesystem::path(::testing::TempDir()) / ("cart_" + std::to_string(::getpid()) + ".yaml");
  std::ofstream(file) << kCart;
  const std::string plan_text =
      "experiment: factorial\n" + text + "\nworkloads: [{name: cart, file: " + file.filename().string() + "}]\n";
  const Result<FactorialPlan> plan = read_factorial_plan(*yaml::parse(plan_text, "plan.yaml"),
                                                         (file.parent_path() / "plan.yaml").string(), executors_of);
  EXPECT_TRUE(plan) << (plan ? "" : to_string(plan.error()));
  std::filesystem::remove(file);
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

Results run_all(Factorial &factorial) {
  for (std::uint64_t unit = 0; unit < factorial.unit_count(); ++unit) {
    const Result<std::string> result = factorial.evaluate(unit);
    EXPECT_TRUE(result) << to_string(result.error());
    EXPECT_EQ(result->find('\n'), std::string::npos);
    EXPECT_TRUE(factorial.add(unit, *result));
  }
  return *factorial.results();
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
    const Point &point = factorial.points()[unit];
    const double wanted = (point[kWorkers] == 0 ? 1 : 4) * (point[kUtilization] == 0 ? 0.3 : 1.5);
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
  Factorial factorial(plan_of("duration: 2s\nrepetitions: 1\nexecutors: [redag]"), simulate_run);
  const Results results = run_all(factorial);
  EXPECT_DOUBLE_EQ(results.rows[1].figures[kFinishedPerSecond]->value, 10);
  EXPECT_DOUBLE_EQ(results.rows[1].figures[kWork]->value, 0.3);
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
  Factorial factorial(
      plan_of("repetitions: 7\nduration: 2s\nworkers: [1, 2]\nexecutors: [unlimited, ideal, redag-none, ste]"),
      simulate_run);
  const Results results = run_all(factorial);
  EXPECT_EQ(results.done, results.units);
  EXPECT_TRUE(results.all_good());
  const auto figure = [&](std::uint32_t executor, std::uint32_t workers, Figure which) {
    for (const ResultRow &row : results.rows) {
      if (row.point[kExecutor] != executor || row.labels[2] != "total") continue;
      if (row.point[kWorkers] != kNoLevel && row.point[kWorkers] != workers) continue;
      return row.figures[which] ? row.figures[which]->value : -1.0;
    }
    return -2.0;
  };
  EXPECT_EQ(figure(0, 0, kMissRatio), 0);
  EXPECT_EQ(figure(1, 0, kMissRatio), 0);
  // The 30 ms of `plan` block the 10 ms of `sense` on one worker: two or three of ten releases miss.
  EXPECT_GT(figure(2, 0, kMissRatio), 0.05);
  EXPECT_EQ(figure(2, 1, kMissRatio), 0);
  EXPECT_EQ(figure(2, 0, kExcessMissRatio), figure(2, 0, kMissRatio));
  EXPECT_EQ(figure(3, 0, kExcessMissRatio), -1);  // ste has one worker at every level, which matches no ideal
  EXPECT_GT(figure(3, 0, kPaperMissRatio), figure(3, 0, kMissRatio) - figure(3, 0, kDropRatio));

  const std::string csv = to_csv(results);
  EXPECT_THAT(csv,
              HasSubstr("workload,policy,workers,utilization,demand_scale,deadline_scale,max_active,executor,world,"
                        "preemption,dag,released,missed,repetitions,miss_ratio,miss_ratio_low,"));
  EXPECT_THAT(csv, HasSubstr("\ncart,,1,,,,,redag-none,simulator,none,total,"));
  EXPECT_THAT(csv, HasSubstr(",0.9844\n"));
  const std::string json = to_json(results, "");
  EXPECT_THAT(json, HasSubstr("\"format\":\"redag.experiment/1\""));
  EXPECT_THAT(json, HasSubstr("\"complete\":true"));
}

TEST(Factorial, UnfinishedResultsSayWhatTheyCan) {
  Factorial factorial(plan_of("repetitions: 2\nduration: 1s\nexecutors: [ideal, mte]"), simulate_run);
  EXPECT_TRUE(factorial.add(1, *factorial.evaluate(1)));
  const Results results = *factorial.results();
  EXPECT_EQ(results.done, 1U);
  EXPECT_EQ(results.units, 4U);
  ASSERT_EQ(results.rows.size(), 3U) << "the DAGs of mte, and both together";
  EXPECT_EQ(results.rows[0].figures[kMissRatio]->confidence, 0);
  EXPECT_EQ(results.rows[0].figures[kExcessMissRatio], std::nullopt);
  EXPECT_EQ(results.rows[2].figures[kResponseMax], std::nullopt) << "of all DAGs together";
  EXPECT_EQ(results.rows[2].counts[0], results.rows[0].counts[0] + results.rows[1].counts[0]);
  EXPECT_FALSE(factorial.add(4, *factorial.evaluate(1)));
  EXPECT_FALSE(factorial.add(2, "[1,2]"));
  EXPECT_FALSE(factorial.add(2, "x"));
}

TEST(Observation, TextGivesItBack) {
  const Factorial factorial(plan_of("duration: 1s\nexecutors: [ste]"), simulate_run);
  const Result<std::string> line = factorial.evaluate(0);
  ASSERT_TRUE(line);
  const Result<Observation> seen = parse_observation(*line);
  ASSERT_TRUE(seen) << to_string(seen.error());
  EXPECT_EQ(to_line(*seen), *line);
  EXPECT_EQ(seen->dags.back().dag, "total");
  EXPECT_EQ(seen->dags.back().released, seen->dags[0].released + seen->dags[1].released);
  EXPECT_TRUE(seen->dags[0].figures[kResponseMax]);
  EXPECT_EQ(seen->dags.back().figures[kResponseMax], std::nullopt);
}

// Three runs of one combination: the DAG `slow` responds within 20, 30 and 20 ns, and once not at all.
TEST(Factorial, MaximaAreOfAllRuns) {
  Factorial factorial(plan_of("duration: 1s\nrepetitions: 3\nexecutors: [redag]"), simulate_run);
  for (std::uint64_t unit = 0; unit < factorial.unit_count(); ++unit) {
    Observation seen = *parse_observation(*factorial.evaluate(unit));
    for (const Figure figure : {kResponseMax, kMaxLateness, kResponseP99})
      seen.dags[1].figures[figure] = unit == 1 ? 30 : 20;
    if (unit == 2) seen.dags[1].figures[kResponseP50] = std::nullopt;
    ASSERT_TRUE(factorial.add(unit, to_line(seen)));
  }
  const ResultRow row = factorial.results()->rows[1];
  for (const Figure figure : {kResponseMax, kMaxLateness}) {
    EXPECT_EQ(row.figures[figure]->value, 30) << kFigureNames[figure];
    EXPECT_EQ(row.figures[figure]->low, 20);
    EXPECT_EQ(row.figures[figure]->high, 30);
  }
  EXPECT_EQ(row.figures[kResponseP99]->value, 20) << "of a percentile the median of the runs";
  EXPECT_GT(row.figures[kResponseP50]->low, 0) << "a run that did not answer is no answer after 0 ns";
}

TEST(Factorial, ExecutorsTakeTurnsOnAMachine) {
  const Factorial simulated(plan_of("executors: [ideal, mte]"), simulate_run);
  EXPECT_FALSE(simulated.takes_turns());
  const Factorial factorial(plan_of("world: threads\nrepetitions: 2\nexecutors: [ideal, redag, mte]"), simulate_run);
  EXPECT_TRUE(factorial.takes_turns());
  std::vector<std::uint64_t> units = {0, 1, 2, 3, 4, 5};
  factorial.arrange(units);
  EXPECT_THAT(units, ::testing::ElementsAre(0, 1, 2, 4, 5, 3));
}

TEST(Factorial, MistakesNameTheCombination) {
  const Factorial factorial(plan_of("workers: [5000]\nexecutors: [redag]"), simulate_run);
  const Result<std::string> result = factorial.evaluate(0);
  ASSERT_FALSE(result);
  EXPECT_THAT(to_string(result.error()), HasSubstr("(workload cart, workers 5000, executor redag)"));
}

}  // namespace
}  // namespace redag::experiment
