// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Checks the statements that workloads/contention.yaml makes about itself.
#include <gtest/gtest.h>

#include "redag/loader/workload_yaml.hpp"
#include "redag/sched/priority_scheduler.hpp"
#include "redag_analysis/metrics/summary.hpp"
#include "redag_analysis/sim/simulator.hpp"
#include "tests/testing/repository.hpp"

namespace redag {
namespace {

metrics::Summary simulate(PreemptionMode mode, PolicyKind policy) {
  Workload workload = load_workload((testing::repository() / "workloads/contention.yaml").string()).value().workload;
  workload.platform.preemption = mode;
  workload.policy = policy;
  trace::RunInfo info;
  info.workload = workload;
  info.config = sched::config_of(workload);
  sim::Options options;
  options.horizon = 20 * kSecond;
  info.end = options.horizon;
  sched::PriorityScheduler scheduler(workload, info.config);
  metrics::Summarizer summarizer(info);
  const sim::Result result = sim::simulate(workload, scheduler, workload.platform.workers, options, [&](auto events) {
    summarizer.add(events);
    return true;
  });
  return summarizer.finish(result.end);
}

TEST(Contention, PreemptionLosesNothing) {
  for (const PreemptionMode mode : {PreemptionMode::Os, PreemptionMode::Cooperative}) {
    EXPECT_EQ(simulate(mode, PolicyKind::RateMonotonic).total.miss_ratio_with_lost(), 0.0) << to_string(mode);
  }
}

TEST(Contention, RunToCompletionLosesATenthOfControl) {
  for (const PolicyKind policy : {PolicyKind::RateMonotonic, PolicyKind::Fifo}) {
    const metrics::Summary summary = simulate(PreemptionMode::None, policy);
    EXPECT_EQ(summary.dags.front().name, "control");
    EXPECT_GT(summary.dags.front().jobs.miss_ratio_with_lost(), 0.1) << to_string(policy);
  }
}

}  // namespace
}  // namespace redag
