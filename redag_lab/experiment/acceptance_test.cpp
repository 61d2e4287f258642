// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/experiment/acceptance.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <set>

#include "redag/loader/workload_yaml.hpp"
#include "redag_analysis/analyze/analyze.hpp"

namespace redag::experiment {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

AcceptancePlan small_plan() {
  AcceptancePlan plan;
  plan.sets = 4;
  plan.utilization = {200'000, 500'000, 800'000};
  plan.dags = {5};
  plan.workers = {1, 2};
  plan.simulation = {3, 3};
  return plan;
}

Results run(Acceptance &acceptance) {
  for (std::uint64_t unit = 0; unit < acceptance.unit_count(); ++unit) {
    const Result<std::string> result = acceptance.evaluate(unit);
    EXPECT_TRUE(result) << to_string(result.error());
    EXPECT_TRUE(acceptance.add(unit, *result)) << *result;
  }
  const Result<Results> results = acceptance.results();
  EXPECT_TRUE(results) << to_string(results.error());
  return *results;
}

TEST(Seed, DiffersWithEveryCoordinateAndItsPlace) {
  std::set<std::uint64_t> seeds;
  for (std::uint64_t a = 0; a < 20; ++a) {
    for (std::uint64_t b = 0; b < 20; ++b) seeds.insert(derive_seed(1, {a, b}));
  }
  EXPECT_EQ(seeds.size(), 400U);
  EXPECT_NE(derive_seed(1, {2, 3}), derive_seed(2, {2, 3}));
  EXPECT_NE(derive_seed(1, {2}), derive_seed(1, {2, 0}));
}

TEST(Acceptance, WorkloadsAreAsThePointSays) {
  AcceptancePlan plan = small_plan();
  plan.workload.min_tasks = 3;
  plan.workload.max_tasks = 6;
  const Acceptance acceptance(plan);
  for (std::uint64_t unit = 0; unit < acceptance.points().size(); ++unit) {
    const lab::GenerateOptions options = generate_options(plan, acceptance.points()[unit]);
    const Result<Workload> workload = acceptance.draw(unit);
    ASSERT_TRUE(workload);
    EXPECT_EQ(workload->dags.size(), 5U);
    EXPECT_EQ(workload->platform.workers, options.workers);
    EXPECT_NEAR(workload->utilization(), options.utilization, 1e-4);
    for (const Dag &dag : workload->dags) {
      EXPECT_GT(dag.deadline, 0);
      EXPECT_LE(dag.deadline, dag.tasks.front().period);
    }
  }
}

TEST(Acceptance, WorkloadsDependOnThePointAlone) {
  AcceptancePlan plan = small_plan();
  plan.workers = {1};
  AcceptancePlan other = plan;
  other.utilization = {500'000};
  other.preemption = {PreemptionMode::Os};
  other.methods = {"guan"};
  other.sets = 100;
  const Acceptance some(plan);    // 6 points, 0.5 is number 1, and number 4 with the other mode
  const Acceptance alone(other);  // 1 point
  EXPECT_EQ(*some.draw(3 * 6 + 4), *alone.draw(3));
  EXPECT_NE(*some.draw(2 * 6 + 4), *alone.draw(3));
  Workload preemptive = *alone.draw(3);
  preemptive.platform.preemption = PreemptionMode::None;
  EXPECT_EQ(*some.draw(3 * 6 + 1), preemptive);
}

TEST(Acceptance, OneMethodOrAll) {
  AcceptancePlan all = small_plan();
  all.methods = {"any"};
  for (const analysis::Method &method : analysis::methods()) all.methods.emplace_back(method.name);
  const Acceptance together(all);
  for (std::size_t m = 1; m < all.methods.size(); ++m) {
    AcceptancePlan one = all;
    one.methods = {all.methods[m]};
    const Acceptance alone(one);
    for (std::uint64_t unit = 0; unit < 12; ++unit) {
      EXPECT_EQ(together.evaluate(unit)->at(m), alone.evaluate(unit)->at(0)) << all.methods[m] << unit;
    }
  }
  const Result<std::string> result = together.evaluate(0);
  EXPECT_NE(result->find(kNotApplicable), std::string::npos);
}

// The simulation accepts every workload that a sound method accepts, for DAGs and tasks, all modes, and one or more
// workers.
TEST(Acceptance, SoundMethodsAcceptNothingThatMisses) {
  for (const std::uint32_t max_tasks : {1U, 6U}) {
    AcceptancePlan plan = small_plan();
    plan.sets = 25;
    plan.workers = {1, 2, 4};
    plan.workload.max_tasks = max_tasks;
    plan.workload.jitter = max_tasks == 1 ? 0.1 : 0.0;
    for (const analysis::Method &method : analysis::methods()) plan.methods.emplace_back(method.name);
    Acceptance acceptance(plan);
    const Results results = run(acceptance);
    for (const Remark &remark : results.remarks) EXPECT_TRUE(remark.good) << remark.text;
    // The comparison is meaningful only if both answers occur.
    std::uint64_t accepted = 0;
    std::uint64_t missed = 0;
    for (const ResultRow &row : results.rows) {
      if (row.point.back() == 0) accepted += row.counts[1];
      if (row.point.back() == 1) missed += row.counts[0] - row.counts[1];
    }
    EXPECT_GT(accepted, 100U);
    EXPECT_GT(missed, 100U);
  }
}

TEST(Acceptance, ViolationsAreFound) {
  AcceptancePlan plan = small_plan();
  plan.methods = {"simulation", "rta_preemptive", "paper_rta", "any"};
  Acceptance acceptance(plan);
  EXPECT_THAT(acceptance.broken_by("0100"), ElementsAre("rta_preemptive"));
  EXPECT_THAT(acceptance.broken_by("0-1u"), ElementsAre("paper_rta"));
  EXPECT_THAT(acceptance.broken_by("00u1"), ElementsAre("any"));
  EXPECT_THAT(acceptance.broken_by("1111"), IsEmpty());
  EXPECT_THAT(acceptance.broken_by("0-u0"), IsEmpty());

  // Finds the first unit that misses and treats it as accepted by a method.
  std::uint64_t unit = 0;
  while (acceptance.evaluate(unit)->front() == kAccepted) ++unit;
  ASSERT_TRUE(acceptance.add(unit, "0100"));
  const Result<Results> results = acceptance.results();
  ASSERT_TRUE(results);
  EXPECT_FALSE(results->all_good());
  EXPECT_THAT(results->remarks.front().text, HasSubstr("although it is accepted by rta_preemptive"));
}

TEST(AcceptanceResults, CountsAndCsv) {
  AcceptancePlan plan;
  plan.sets = 2;
  plan.utilization = {500'000};
  plan.preemption = {PreemptionMode::Os};
  plan.methods = {"any", "guan", "paper_rta"};
  Acceptance acceptance(plan);
  ASSERT_TRUE(acceptance.add(0, "1-u"));
  EXPECT_EQ(acceptance.results()->done, 1U);
  ASSERT_TRUE(acceptance.add(1, "0-1"));
  const Results results = *acceptance.results();
  EXPECT_EQ(results.done, results.units);
  EXPECT_EQ(to_csv(results),
            "dags,workers,preemption,utilization,method,sets,accepted,unsound,not_applicable,accepted_ratio,"
            "accepted_ratio_low,accepted_ratio_high,confidence\n"
            "10,4,os,0.5,any,2,1,0,0,0.5,0.0945312,0.905469,0.95\n"
            "10,4,os,0.5,guan,2,0,0,2,,,,\n"
            "10,4,os,0.5,paper_rta,2,2,1,0,1,0.34238,1,0.95\n");
  const std::string json = to_json(results, "experiment: acceptance\n");
  EXPECT_THAT(json, HasSubstr("\"format\":\"redag.experiment/1\""));
  EXPECT_THAT(json, HasSubstr("\"counts\":[2,0,0,2],\"confidence\":0.0,\"values\":[null]"));
  EXPECT_THAT(json, HasSubstr("\"values\":[[0.5,0.0945312,0.905469]]"));
  EXPECT_FALSE(acceptance.add(2, "111"));
  EXPECT_FALSE(acceptance.add(0, "11"));
  EXPECT_FALSE(acceptance.add(0, "11x"));
}

}  // namespace
}  // namespace redag::experiment
