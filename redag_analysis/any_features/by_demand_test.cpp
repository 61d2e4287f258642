// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/any_features/by_demand.hpp"

#include <gtest/gtest.h>

#include <span>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "redag/loader/workload_yaml.hpp"
#include "redag/sched/priority_scheduler.hpp"
#include "redag_analysis/metrics/jobs.hpp"
#include "redag_analysis/sim/simulator.hpp"
#include "tests/testing/bound_property.hpp"

namespace redag::analysis {
namespace {

struct Found {
  TaskSet task_set;
  Bound bound;
};

Found found_for(const std::string &yaml) {
  const auto loaded = parse_workload(yaml, "case.yaml", {.waits = true});
  EXPECT_TRUE(loaded) << (loaded ? "" : to_string(loaded.error()));
  if (!loaded) return {};
  TaskSet task_set = testing::compiled(loaded->workload);
  const Outcome outcome = by_demand().apply(task_set);
  return {std::move(task_set), std::get<Bound>(outcome)};
}

// A device serves the urgent task next. Of what is less urgent, one service can have begun.
TEST(ByDemand, OneLessUrgentServiceForEachRequest) {
  for (const char *queue : {"priority", "fifo"}) {
    for (const int workers : {1, 2}) {
      const Found found = found_for("platform: {workers: " + std::to_string(workers) +
                                    ", preemption: os, devices: {gpu: {queue: " + queue + R"(}}}
dags:
  - name: a
    tasks: [{name: t, period: 20ms, segments: [{cpu: 1ms}, {device: gpu, for: 2ms}, {cpu: 1ms}]}]
  - name: b
    tasks: [{name: t, period: 30ms, concurrency: 2, segments: [{cpu: 1ms}, {device: gpu, for: 6ms}, {cpu: 1ms}]}]
)");
      ASSERT_EQ(found.bound.tasks.size(), 2U);
      // In a queue of requests, both unfinished jobs of b can be served before.
      const Duration before = std::string(queue) == "fifo" ? 2 * 6 : 6;
      EXPECT_EQ(found.bound.tasks[0].response, (4 + before) * kMillisecond) << queue << ", " << workers;
    }
  }
}

// The timer `act` has data of its own release, or is skipped at the next one.
TEST(ByDemand, ATimerBehindDataOfItsRelease) {
  const auto with = [](const std::string &details) {
    return found_for(R"(
platform: {workers: 2, preemption: os}
dags:
  - name: a
    tasks:
      - {name: read, wcet: 1ms, period: 20ms}
      - {name: work, wcet: 2ms, activation: data, after: read, budget: 1ms}
      - {name: act, wcet: 1ms, activation: timer, period: 20ms, after: work)" +
                     details + "}\n");
  };
  const ResponseBound act = with("").bound.tasks[2];
  EXPECT_TRUE(act.of_ended);
  ASSERT_TRUE(act.response);
  EXPECT_LE(*act.response, 20 * kMillisecond);
  // Its next release is seen late, and can come after data of the next job of `work`.
  EXPECT_FALSE(with(", jitter: 1ms").bound.tasks[2].response);
  EXPECT_FALSE(with(", budget: 500us, on_budget: skip_next").bound.tasks[2].response);
}

// Only by_demand covers a budget below the wcet. It takes no bound of all jobs from others, nor their end-to-end one.
TEST(ByDemand, AcrossRatesNoJobIsLost) {
  const Found found = found_for(R"(
platform: {workers: 2, preemption: os}
dags:
  - name: fusion
    tasks:
      - {name: imu, wcet: 1ms, period: 10ms}
      - {name: camera, wcet: 2ms, period: 40ms}
      - {name: fuse, wcet: 2ms, activation: data, after: [imu, camera]}
  - name: log
    tasks: [{name: write, wcet: 4ms, period: 100ms, budget: 3ms}]
)");
  ASSERT_EQ(found.bound.tasks.size(), 4U);
  for (std::size_t t = 0; t < 3; ++t) {
    EXPECT_TRUE(found.bound.tasks[t].response) << t;
    EXPECT_FALSE(found.bound.tasks[t].of_ended) << t;
  }
  EXPECT_TRUE(found.bound.tasks[3].of_ended);
  EXPECT_TRUE(found.bound.dags[0].response);
}

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

// A holder that inherits preempts once more, and with a max_active more often.
TEST(BoundProperty, ByDemandOfGroupsWithOverheads) {
  for (const bool caps : {false, true}) {
    testing::BoundCaseLimits limits;
    limits.max_workers = 3;
    limits.groups = limits.overheads = limits.jitter = limits.edges = true;
    limits.caps = caps;
    limits.max_utilization = 0.8;
    testing::expect_bound_holds(by_demand(), testing::cases(limits), {.workloads = 300, .include_refused = true});
  }
}

}  // namespace
}  // namespace redag::analysis
