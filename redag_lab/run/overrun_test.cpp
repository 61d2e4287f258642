// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Tests the alarms of real runs. A body that overruns its wcet is found by its processor time, even on a busy machine.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <utility>
#include <vector>

#include "redag/threads/clock.hpp"
#include "redag_analysis/metrics/assumptions.hpp"
#include "redag_lab/run/run_workload.hpp"
#include "redag_lab/run/synthetic.hpp"
#include "tests/testing/builders.hpp"

namespace redag::lab {
namespace {

using redag::testing::make_dag;
using redag::testing::make_workload;

// Runs 2 ms every `period` ms, and every other one.
trace::Trace run(Duration period, RunOptions options) {
  const Workload workload = make_workload({make_dag("a", {{.name = "a", .period = period, .wcet = 2}}),
                                           make_dag("b", {{.name = "b", .period = 2 * period, .wcet = 2}})},
                                          1);
  options.duration = 60 * period * kMillisecond;
  options.preemption = PreemptionMode::None;
  Result<RunResult> result = run_workload(workload, options);
  EXPECT_TRUE(result);
  return std::move(result->trace);
}

TEST(Overrun, AFifthInEveryJobIsAnAlarm) {
  std::atomic<bool> give_up{false};
  RunOptions options;
  options.bodies = [&](std::vector<runtime::Body> bodies, const Now &) {
    bodies[0] = [&](const runtime::Job &) {
      burn(2400 * kMicrosecond, 0, give_up);
      return sched::Outcome::Finished;
    };
    return bodies;
  };
  const trace::Trace trace = run(10, options);
  const metrics::AssumptionCheck check =
      metrics::check_assumptions(trace.info, trace.events, [](TaskId) { return Duration{0}; });
  EXPECT_GE(check.tasks[0].execution.jobs, 10U);
  EXPECT_TRUE(check.tasks[0].execution.is_exceeded);
}

// The least of all jobs of a task: a stalling machine can charge some of them with more.
struct Least {
  Duration own = kNever;      // processor time of the body, as it reads it itself
  Duration charged = kNever;  // by the engine
};

// A body that itself takes longer than its demand does so in every job, whatever else the machine does.
TEST(Overrun, SyntheticBodiesKeepTheirWcet) {
  constexpr Duration kWcet = 2 * kMillisecond;
  std::array<Least, 2> least;
  RunOptions options;
  options.bodies = [&](std::vector<runtime::Body> bodies, const Now &) {
    for (std::size_t t = 0; t < bodies.size(); ++t) {
      bodies[t] = [body = bodies[t], &own = least.at(t).own](const runtime::Job &job) {
        const Duration before = runtime::thread_cpu_now();
        const sched::Outcome outcome = body(job);
        own = std::min(own, runtime::thread_cpu_now() - before);
        return outcome;
      };
    }
    return bodies;
  };
  const trace::Trace trace = run(30, options);  // on a machine with much other work, some jobs end in time
  for (const JobEvent &event : trace.events) {
    if (event.kind != JobEventKind::Executed) continue;
    EXPECT_GT(event.value, kWcet * 95 / 100) << event.task.value;
    Duration &charged = least.at(event.task.value).charged;
    charged = std::min(charged, event.value);
  }
  for (const Least &one : least) {
    EXPECT_LE(one.own, kWcet * 1005 / 1000);
    EXPECT_LE(one.charged, kWcet * 105 / 100) << "the engine charges much more than a body uses";
  }
}

}  // namespace
}  // namespace redag::lab
