// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/analyze/executors.hpp"

#include <gtest/gtest.h>

#include <algorithm>

#include "redag_analysis/analyze/analyze.hpp"
#include "redag_analysis/many_workers/dag_isolated.hpp"
#include "redag_analysis/many_workers/global_dag.hpp"
#include "tests/testing/bound_property.hpp"
#include "tests/testing/builders.hpp"

namespace redag::analysis {
namespace {

const executors::ExecutorKind &executor(std::string_view name) { return *executors::find_executor(name); }

bool has_method(const executors::ExecutorKind &kind, std::string_view name) {
  const std::vector<Method> &methods = methods_of(kind);
  return std::any_of(methods.begin(), methods.end(), [name](const Method &method) { return method.name == name; });
}

// Tests the bound under every executor but ours, with max_active, which none of them knows.
void expect_holds(const Method &method, testing::BoundCaseLimits limits) {
  limits.policies = {PolicyKind::RateMonotonic};
  limits.preemption = sched::Preemption::None;
  limits.jitter = limits.caps = limits.overheads = true;
  limits.min_period = 20;
  limits.max_period = 300;
  limits.min_utilization = 0.02;
  limits.max_utilization = 0.5;
  for (const executors::ExecutorKind &kind : executors::all()) {
    if (kind.ours) continue;
    ASSERT_TRUE(has_method(kind, method.name)) << kind.name;
    limits.max_workers = kind.single_worker ? 1 : 4;
    const testing::BoundPropertyOptions options{.workloads = 150, .executor = std::string(kind.name)};
    testing::expect_bound_holds(
        method, [&limits](Rng &rng) { return random_bound_case(rng, limits); }, options);
  }
}

TEST(BoundProperty, OtherExecutorsKeepDagAny) { expect_holds(dag_any(), {.edges = true, .max_dags = 4}); }
TEST(BoundProperty, OtherExecutorsKeepDagAnyOfTasks) { expect_holds(dag_any(), {}); }
TEST(BoundProperty, OtherExecutorsKeepIsolated) { expect_holds(isolated(), {.edges = true, .max_dags = 2}); }

TEST(Executors, OursHasAllMethodsAndPeersHaveTheirs) {
  EXPECT_EQ(&methods_of(executor("redag")), &methods());
  for (const Method &method : executor_methods()) {
    EXPECT_TRUE(has_method(executor("ste"), method.name) && has_method(executor("mte"), method.name)) << method.name;
    EXPECT_FALSE(has_method(executor("redag"), method.name)) << method.name;
    // These executors walk through windows in another order, or have none.
    for (const char *name : {"static", "events", "cbg"}) EXPECT_FALSE(has_method(executor(name), method.name)) << name;
  }
  // No peer gets a bound that relies on priorities.
  for (const char *name : {"ste", "mte", "static", "events", "cbg"}) {
    EXPECT_FALSE(has_method(executor(name), "rta_nonpreemptive")) << name;
    EXPECT_FALSE(has_method(executor(name), "sequential_nonpreemptive")) << name;
  }
}

// Both windows and work limit how much others can do: each bound is somewhere the tightest.
TEST(Executors, TheTightestOfSeveralIsTaken) {
  using testing::make_dag;
  const Workload workload = testing::make_workload({make_dag("fast", {{.name = "f", .period = 100, .wcet = 2}}),
                                                    make_dag("slow", {{.name = "s", .period = 120, .wcet = 20}})},
                                                   1);
  for (const char *name : {"ste", "events"}) {
    const TaskSet task_set = compile_for(executor(name), workload, platform_of(workload)).value();
    const Report report = analyze(task_set, methods_of(executor(name)));
    ASSERT_TRUE(report.tasks[1].response) << name;
    EXPECT_EQ(*report.tasks[0].response, (20 + 2) * kMillisecond) << name;
    EXPECT_EQ(*report.tasks[1].response, (20 + 2) * kMillisecond) << name << ": f comes once while s waits";
    EXPECT_EQ(report.verdict, Verdict::Schedulable);
  }
}

TEST(Executors, PeersRunOnTheirOwnPlatformAndIgnoreMaxActive) {
  Workload workload = testing::make_workload(
      {testing::make_dag("d", {{"a", 100, 10}, {"b", 0, 10, {0}}, {"c", 0, 10, {0}}}, 1)}, 4, PreemptionMode::Os);
  AnalysisPlatform platform = platform_of(workload);
  platform.levels = 2;
  platform.max_started = 7;
  const TaskSet ours = compile_for(executor("redag"), workload, platform).value();
  EXPECT_EQ(ours.platform, platform);
  EXPECT_EQ(ours.dags[0].max_active, 1U);
  const TaskSet mte = compile_for(executor("mte"), workload, platform).value();
  EXPECT_EQ(mte.platform.workers, 4U);
  EXPECT_EQ(mte.mode, sched::Preemption::None);
  EXPECT_EQ(mte.platform.levels + mte.platform.max_started, 0U);
  EXPECT_EQ(mte.dags[0].max_active, 0U);
  EXPECT_EQ(analyze(mte, methods_of(executor("mte"))).dags[0].response, 20 * kMillisecond) << "b beside c";
  EXPECT_EQ(compile_for(executor("static"), workload, platform)->platform.workers, 1U);
}

}  // namespace
}  // namespace redag::analysis
