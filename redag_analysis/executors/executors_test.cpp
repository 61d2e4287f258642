// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/executors/executors.hpp"

#include <gtest/gtest.h>

#include <map>
#include <memory>
#include <span>
#include <vector>

#include "redag/loader/workload_yaml.hpp"
#include "redag/sched/priority_scheduler.hpp"
#include "redag_analysis/executors/clustered.hpp"
#include "redag_analysis/metrics/jobs.hpp"
#include "redag_analysis/sim/simulator.hpp"
#include "tests/testing/builders.hpp"

namespace redag::executors {
namespace {

Workload two_timers() { return testing::make_workload({testing::tick_dag("d", {{"a", 100}, {"b", 10}})}); }

TEST(Executors, AreFoundByNameOursFirst) {
  EXPECT_EQ(all().front().name, "redag");
  for (const ExecutorKind &kind : all()) {
    EXPECT_EQ(find_executor(kind.name), &kind);
    EXPECT_FALSE(kind.description.empty());
  }
  EXPECT_EQ(find_executor("cfs"), nullptr);
}

TEST(Executors, AModelOfRclcppDoesNotPreempt) {
  const sched::Config config{4, sched::Preemption::Full, PolicyKind::RateMonotonic, 3, 8};
  const sched::Config mte = effective_config(*find_executor("mte"), config);
  EXPECT_EQ(mte.preemption, sched::Preemption::None);
  EXPECT_EQ(mte.workers, 4U);
  EXPECT_EQ(mte.levels + mte.max_started, 0U);
  EXPECT_EQ(effective_config(*find_executor("ste"), config).workers, 1U);
  EXPECT_EQ(effective_config(*find_executor("redag"), config).preemption, sched::Preemption::Full);
}

// The faster of two timers is the second one: only our executor considers the rates.
TEST(Executors, MakeSchedulersThatDifferInWhoIsFirst) {
  for (const ExecutorKind &kind : all()) {
    const auto scheduler = make_scheduler(kind.name, two_timers(), sched::Config{});
    scheduler->release(TaskId(0), 0, 0);
    scheduler->release(TaskId(1), 0, 0);
    const sched::Step step = scheduler->dispatch(0);
    ASSERT_EQ(step.dispatches.size(), 1U) << kind.name;
    EXPECT_EQ(step.dispatches[0].task, TaskId(kind.name == "redag" ? 1 : 0)) << kind.name;
  }
}

// A request of the other cluster is ahead; nothing else delays the three jobs.
TEST(Clustered, ClustersShareADevice) {
  const auto loaded = parse_workload(R"(
platform: {clusters: [{name: a}, {name: b}], devices: {gpu: {slots: 1, queue: fifo}}}
dags:
  - {name: x, cluster: a, tasks: [{name: t, period: 1s, segments: [{cpu: 4ms}, {device: gpu, for: 16ms}, {cpu: 1ms}]}]}
  - name: y
    cluster: b
    tasks:
      - {name: t, period: 1s, offset: 2ms, segments: [{cpu: 3ms}, {device: gpu, for: 8ms}, {cpu: 3ms}]}
      - {name: u, period: 1s, offset: 6ms, segments: [{cpu: 1ms}, {device: gpu, for: 2ms}, {cpu: 1ms}]}
)",
                                     "shared.yaml", {.waits = true});
  ASSERT_TRUE(loaded) << to_string(loaded.error());
  ClusteredScheduler scheduler(loaded->workload, [](const ClusterPart &part) {
    return std::make_unique<sched::PriorityScheduler>(part.workload, sched::config_of(part.workload));
  });
  sim::Options options;
  options.horizon = kSecond;
  std::vector<JobEvent> events;
  static_cast<void>(sim::simulate(loaded->workload, scheduler, 2, options, [&](std::span<const JobEvent> some) {
    events.insert(events.end(), some.begin(), some.end());
    return true;
  }));
  std::map<std::uint32_t, Duration> found;
  for (const metrics::JobRecord &job : metrics::fold_jobs(loaded->workload, events)) {
    found[job.task.value] = job.response() / kMillisecond;
  }
  EXPECT_EQ(found, (std::map<std::uint32_t, Duration>{{0, 21}, {1, 29}, {2, 26}}));
}

TEST(ExecutorsDeathTest, AnUnknownNameIsAMistakeOfTheCaller) {
  EXPECT_DEATH(static_cast<void>(make_scheduler("cfs", two_timers(), sched::Config{})),
               "there is no executor of this name");
}

}  // namespace
}  // namespace redag::executors
