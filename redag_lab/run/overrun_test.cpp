// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Tests the alarms of real runs. A body that overruns its wcet is found by its processor time, even on a busy machine.
#include <gtest/gtest.h>

#include <atomic>

#include "redag_analysis/metrics/assumptions.hpp"
#include "redag_lab/run/run_workload.hpp"
#include "redag_lab/run/synthetic.hpp"
#include "redag_testing/builders.hpp"

namespace redag::lab {
namespace {

using redag::testing::make_dag;
using redag::testing::make_workload;

metrics::AssumptionCheck run(Duration extra_of_first) {
  const Workload workload = make_workload({make_dag("a", {{.name = "a", .period = 10, .wcet = 2}}),
                                           make_dag("b", {{.name = "b", .period = 20, .wcet = 2}})},
                                          1);
  std::atomic<bool> give_up{false};
  RunOptions options;
  options.duration = 600 * kMillisecond;
  options.preemption = PreemptionMode::None;
  options.bodies = [&](std::vector<runtime::Body> bodies, const Now &) {
    bodies[0] = [&give_up, extra_of_first](const runtime::Job &) {
      burn(2 * kMillisecond + extra_of_first, 0, give_up);
      return sched::Outcome::Finished;
    };
    return bodies;
  };
  const Result<RunResult> result = run_workload(workload, options);
  EXPECT_TRUE(result);
  return metrics::check_assumptions(result->trace.info, result->trace.events, [](TaskId) { return Duration{0}; });
}

TEST(Overrun, AFifthInEveryJobIsAnAlarm) {
  const metrics::AssumptionCheck check = run(400 * kMicrosecond);
  EXPECT_GE(check.tasks[0].execution.jobs, 10U);
  EXPECT_TRUE(check.tasks[0].execution.is_exceeded);
}

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
constexpr bool kEngineIsSlow = true;  // what the engine does after a body, and is charged to it, is instrumented
#else
constexpr bool kEngineIsSlow = false;
#endif

// A stalling machine can charge jobs more than they used. A body that itself takes longer does so in every job.
TEST(Overrun, SyntheticBodiesKeepTheirWcet) {
  const metrics::AssumptionCheck check = run(0);
  for (const metrics::TaskCheck &task : check.tasks) {
    EXPECT_GE(task.execution.jobs, 5U);
    if (!kEngineIsSlow) {
      EXPECT_LT(task.execution.above, task.execution.jobs) << task.task.value;
    }
    EXPECT_GT(task.execution.longest, 1900 * kMicrosecond);
  }
}

}  // namespace
}  // namespace redag::lab
