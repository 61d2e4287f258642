// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/many_workers/by_demand.hpp"

#include <gtest/gtest.h>

#include <span>
#include <variant>
#include <vector>

#include "redag/loader/workload_yaml.hpp"
#include "redag/sched/priority_scheduler.hpp"
#include "redag_analysis/metrics/jobs.hpp"
#include "redag_analysis/sim/simulator.hpp"
#include "tests/testing/bound_property.hpp"

namespace redag::analysis {
namespace {

// A demoted job gives its worker to jobs that were preempted before, and resumes once more itself.
TEST(ByDemand, ADemotedJobPaysForItsResumption) {
  const auto loaded = parse_workload(R"(
platform: {workers: 1, preemption: os}
policy: fixed
ties: fixed
dags:
  - {name: y, tasks: [{name: t, wcet: 10ns, period: 1us, priority: 0}]}
  - {name: x, tasks: [{name: t, wcet: 10ns, period: 1us, offset: 1ns, priority: 1}]}
  - {name: a, tasks: [{name: t, wcet: 20ns, period: 1us, offset: 2ns, priority: 2, budget: 10ns, on_budget: demote}]}
  - {name: b, tasks: [{name: t, wcet: 20ns, period: 1us, offset: 18ns, priority: 3, budget: 10ns, on_budget: demote}]}
  - {name: c, tasks: [{name: t, wcet: 20ns, period: 1us, offset: 34ns, priority: 4, budget: 10ns, on_budget: demote}]}
)",
                                     "demoted.yaml");
  ASSERT_TRUE(loaded) << to_string(loaded.error());
  AnalysisPlatform platform = platform_of(loaded->workload);
  platform.preempt_overhead = 5;
  const Outcome outcome = by_demand().apply(testing::compiled(loaded->workload, platform));
  sched::PriorityScheduler scheduler(loaded->workload, sched::config_of(loaded->workload));
  sim::Options options;
  options.horizon = 900;
  options.overheads.preempt = 5;
  std::vector<JobEvent> events;
  static_cast<void>(sim::simulate(loaded->workload, scheduler, 1, options, [&](std::span<const JobEvent> some) {
    events.insert(events.end(), some.begin(), some.end());
    return true;
  }));
  for (const metrics::JobRecord &job : metrics::fold_jobs(loaded->workload, events)) {
    EXPECT_LE(job.response(), std::get<Bound>(outcome).tasks[job.task.value].response.value_or(0)) << job.task.value;
    if (job.task == TaskId(2)) {
      EXPECT_EQ(job.response(), 113);
    }
  }
}

}  // namespace
}  // namespace redag::analysis
