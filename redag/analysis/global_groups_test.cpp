#include "redag/analysis/global_groups.hpp"

#include <gtest/gtest.h>

#include "redag/testing/bound_property.hpp"

namespace redag::analysis {
namespace {

using testing::BoundCaseLimits;
using testing::expect_bound_holds;

BoundCaseLimits with_groups(bool edges) {
  BoundCaseLimits limits;
  limits.preemption = sched::Preemption::None;
  limits.max_workers = 4;
  limits.edges = edges;
  limits.groups = true;
  limits.max_dags = edges ? 4 : 7;
  limits.max_tasks = 6;
  limits.jitter = limits.overheads = true;
  limits.max_deadline = 1.5;
  limits.min_utilization = 0.05;
  limits.max_utilization = 0.4;
  limits.min_period = 10;
  limits.max_period = 150;
  return limits;
}

testing::BoundGenerator cases(const BoundCaseLimits &limits) {
  return [limits](Rng &rng) { return testing::random_bound_case(rng, limits); };
}

TEST(BoundProperty, DagGroups) { expect_bound_holds(dag_groups(), cases(with_groups(true)), {.workloads = 2000}); }

TEST(BoundProperty, DagGroupsOfIndependentTasks) {
  expect_bound_holds(dag_groups(), cases(with_groups(false)), {.workloads = 2000});
}

Task in_group(std::string name, Duration wcet, Duration period) {
  Task task;
  task.name = std::move(name);
  task.wcet = task.bcet = wcet;
  task.period = task.deadline = period;
  task.group = "driver";
  return task;
}

// Two workers, three tasks of one group: the workers do not help, so the least urgent waits for both others in full.
TEST(GlobalGroups, AGroupIsOneWorker) {
  Workload workload;
  workload.name = "w";
  workload.platform.workers = 2;
  for (const Duration period : {100, 200, 300}) {
    Dag dag;
    dag.name = "d" + std::to_string(period);
    dag.tasks.push_back(in_group("t", 10, period));
    workload.dags.push_back(dag);
  }
  AnalysisPlatform platform;
  platform.workers = 2;
  platform.preemption = sched::Preemption::None;
  const System system = compile(workload, platform).value();
  const Outcome outcome = dag_groups().apply(system);
  const auto &bound = std::get<Bound>(outcome);
  EXPECT_GE(bound.tasks[0].response.value(), 10 + 9);
  EXPECT_GE(bound.tasks[2].response.value(), 30);

  platform.preemption = sched::Preemption::Full;
  EXPECT_TRUE(std::holds_alternative<NotApplicable>(dag_groups().apply(compile(workload, platform).value())));
}

TEST(GlobalGroups, TermsAddUp) {
  std::uint64_t applied = 0;
  for (std::uint64_t seed = 0; seed < 1000; ++seed) {
    Rng rng(mix(seed));
    const testing::BoundCase bound_case = random_bound_case(rng, with_groups(seed % 2 == 0));
    const System system = compile(bound_case.workload, bound_case.platform).value();
    const Outcome outcome = dag_groups().apply(system);
    if (!std::holds_alternative<Bound>(outcome)) continue;
    ++applied;
    for (const ResponseBound &bound : std::get<Bound>(outcome).tasks) {
      Duration sum = 0;
      for (const Term &term : bound.terms) sum += term.amount;
      ASSERT_EQ(sum, bound.response.value_or(0)) << describe(bound_case);
    }
  }
  EXPECT_GT(applied, 300U);
}

}  // namespace
}  // namespace redag::analysis
