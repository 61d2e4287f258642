// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/experiment/acceptance.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <set>

#include "redag/model/workload_yaml.hpp"
#include "redag_analysis/analyze/analyze.hpp"
#include "redag_lab/experiment/acceptance_results.hpp"
#include "redag_lab/experiment/line_plot.hpp"
#include "redag_lab/experiment/seed.hpp"

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

AcceptanceResults run(const Acceptance &acceptance) {
  AcceptanceCounter counter(acceptance);
  for (std::uint64_t unit = 0; unit < unit_count(acceptance.plan()); ++unit) {
    const Result<std::string> result = acceptance.evaluate(unit);
    EXPECT_TRUE(result) << to_string(result.error());
    EXPECT_TRUE(acceptance.is_result(*result)) << *result;
    EXPECT_TRUE(counter.add(unit, *result));
  }
  return counter.results();
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
  plan.deadlines = {DeadlineKind::Constrained};
  for (const AcceptancePoint &point : points_of(plan)) {
    const Result<Workload> workload = draw_workload(plan, point, 0);
    ASSERT_TRUE(workload);
    EXPECT_EQ(workload->dags.size(), 5U);
    EXPECT_EQ(workload->platform.workers, point.workers);
    EXPECT_NEAR(workload->utilization(), point.workers * point.utilization / 1e6, 1e-4);
    for (const Dag &dag : workload->dags) {
      EXPECT_GT(dag.deadline, 0);
      EXPECT_LE(dag.deadline, dag.tasks.front().period);
    }
  }
}

// A grid can be refined, or a mode added, without changing the workloads of other points.
TEST(Acceptance, WorkloadsDependOnThePointAlone) {
  const AcceptancePlan plan = small_plan();
  AcceptancePlan other = plan;
  other.utilization = {500'000};
  other.preemption = {PreemptionMode::Os};
  other.methods = {"guan"};
  other.sets = 100;
  AcceptancePoint point = points_of(other).front();
  EXPECT_EQ(*draw_workload(plan, point, 3), *draw_workload(other, point, 3));
  EXPECT_NE(*draw_workload(plan, point, 3), *draw_workload(plan, point, 2));
  Workload preemptive = *draw_workload(plan, point, 3);
  point.preemption = PreemptionMode::None;
  preemptive.platform.preemption = PreemptionMode::None;
  EXPECT_EQ(*draw_workload(plan, point, 3), preemptive);
}

// A method's verdict on a unit does not depend on the other methods of the plan.
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
    plan.deadlines = {DeadlineKind::Implicit, DeadlineKind::Constrained};
    plan.workload.max_tasks = max_tasks;
    plan.workload.jitter = max_tasks == 1 ? 0.1 : 0.0;
    for (const analysis::Method &method : analysis::methods()) plan.methods.emplace_back(method.name);
    const Acceptance acceptance(plan);
    const AcceptanceResults results = run(acceptance);
    for (const Violation &violation : results.violations) {
      ADD_FAILURE() << *acceptance.replay(violation.unit, violation.result);
    }
    // The comparison is meaningful only if both answers occur.
    std::uint64_t accepted = 0;
    std::uint64_t missed = 0;
    for (const AcceptanceRow &row : results.rows) {
      accepted += row.cells[0].accepted;
      missed += row.sets - row.cells[1].accepted;
    }
    EXPECT_GT(accepted, 100U);
    EXPECT_GT(missed, 100U);
  }
}

TEST(Acceptance, ViolationsAreFoundAndReplayed) {
  AcceptancePlan plan = small_plan();
  plan.methods = {"simulation", "rta_preemptive", "paper_rta", "any"};
  const Acceptance acceptance(plan);
  EXPECT_THAT(acceptance.broken_by("0100"), ElementsAre("rta_preemptive"));
  EXPECT_THAT(acceptance.broken_by("0-1u"), ElementsAre("paper_rta"));
  EXPECT_THAT(acceptance.broken_by("00u1"), ElementsAre("any"));
  EXPECT_THAT(acceptance.broken_by("1111"), IsEmpty());
  EXPECT_THAT(acceptance.broken_by("0-u0"), IsEmpty());

  // Finds the first unit that misses and treats it as accepted by a method.
  std::uint64_t unit = 0;
  while (acceptance.evaluate(unit)->front() == kAccepted) ++unit;
  const Result<std::string> text = acceptance.replay(unit, "0100");
  ASSERT_TRUE(text) << to_string(text.error());
  EXPECT_THAT(*text, HasSubstr("# accepted by: rta_preemptive\n"));
  EXPECT_THAT(*text, HasSubstr("# redag simulate THIS_FILE --duration "));
  EXPECT_TRUE(parse_workload(*text, "replay.yaml")) << *text;
}

TEST(AcceptanceResults, CountsAndCsv) {
  AcceptancePlan plan;
  plan.sets = 2;
  plan.utilization = {500'000};
  plan.preemption = {PreemptionMode::Os};
  plan.methods = {"any", "guan", "paper_rta"};
  const Acceptance acceptance(plan);
  AcceptanceCounter counter(acceptance);
  ASSERT_TRUE(counter.add(0, "1-u"));
  EXPECT_FALSE(counter.results().complete());
  ASSERT_TRUE(counter.add(1, "001"));
  EXPECT_TRUE(counter.results().complete());
  EXPECT_EQ(to_csv(acceptance, counter.results()),
            "dags,workers,deadlines,preemption,utilization,method,sets,accepted,ratio,ratio_low,ratio_high,unsound,"
            "not_applicable\n"
            "10,4,implicit,os,0.5,any,2,1,0.500000,0.094531,0.905469,0,0\n"
            "10,4,implicit,os,0.5,guan,2,0,0.000000,0.000000,0.657620,0,1\n"
            "10,4,implicit,os,0.5,paper_rta,2,2,1.000000,0.342380,1.000000,1,0\n");
  EXPECT_FALSE(counter.add(2, "111"));
  EXPECT_FALSE(counter.add(0, "11"));
  EXPECT_FALSE(counter.add(0, "11x"));
}

TEST(AcceptanceResults, PlotHasAPanelForEachModeAndALineForEachMethod) {
  AcceptancePlan plan = small_plan();
  plan.workers = {2};
  plan.methods = {"any", "simulation", "rta_preemptive"};
  const Acceptance acceptance(plan);
  const std::string svg = to_svg(acceptance, run(acceptance));
  EXPECT_THAT(svg, HasSubstr("5 tasks, 2 workers, no preemption"));
  EXPECT_THAT(svg, HasSubstr("5 tasks, 2 workers, full preemption"));
  EXPECT_THAT(svg, HasSubstr(">simulation<"));
  EXPECT_THAT(svg, HasSubstr("rta_preemptive (does not apply)"));
}

TEST(LinePlot, NamesAreText) {
  LinePlot plot;
  plot.title = "a < b & c";
  plot.lines = {"<x>"};
  plot.panels.resize(1);
  plot.panels[0].title = "p";
  plot.panels[0].series = {{{0.1, 1, 0.9, 1}, {0.2, 0, 0, 0.1}}};
  const std::string svg = to_svg(plot);
  EXPECT_THAT(svg, HasSubstr("a &lt; b &amp; c"));
  EXPECT_THAT(svg, HasSubstr("&lt;x&gt;"));
  EXPECT_THAT(svg, ::testing::EndsWith("</svg>\n"));
}

}  // namespace
}  // namespace redag::experiment
