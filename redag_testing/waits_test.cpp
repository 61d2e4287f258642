// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Random workloads whose jobs wait for devices, simulated: PriorityScheduler gives the jobs of ReferenceScheduler, and
// the trace keeps every rule. The parts of each response sum to it. What the scheduler does when a driver reports waits
// in any order is in differential_test.cpp.
#include <cstdint>
#include <string>
#include <tuple>
#include <vector>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "redag/base/rng.hpp"
#include "redag/sched/priority_scheduler.hpp"
#include "redag_analysis/metrics/jobs.hpp"
#include "redag_analysis/metrics/trace_checker.hpp"
#include "redag_analysis/sim/simulator.hpp"
#include "redag_testing/environment.hpp"
#include "redag_testing/random_workloads.hpp"
#include "redag_testing/reference_scheduler.hpp"

namespace redag::testing {
namespace {

using sched::Preemption;

trace::Trace simulated(const trace::RunInfo &info, sched::Scheduler &scheduler) {
  trace::Trace trace{info, {}};
  sim::Options options;
  options.horizon = info.end;
  options.seed = info.seed;
  const auto keep = [&](std::span<const JobEvent> events) {
    trace.events.insert(trace.events.end(), events.begin(), events.end());
    return true;
  };
  static_cast<void>(sim::simulate(info.workload, scheduler, info.config.workers, options, keep));
  return trace;
}

// The jobs without `deferred`: a job that waits for its group or a thread may count as deferred on one side alone.
std::vector<metrics::JobRecord> jobs_of(const trace::Trace &trace) {
  std::vector<metrics::JobRecord> jobs = metrics::fold_jobs(trace.info.workload, trace.events);
  for (metrics::JobRecord &job : jobs) job.deferred = false;
  return jobs;
}

class SimulatedWaits : public ::testing::TestWithParam<std::tuple<PolicyKind, Preemption>> {};

// REDAG_WAITS_SEED and REDAG_WAITS_COUNT choose other workloads than the default ones.
TEST_P(SimulatedWaits, FollowTheModel) {
  const auto [policy, preemption] = GetParam();
  const std::uint64_t first = from_environment("REDAG_WAITS_SEED").value_or(1);
  const std::uint64_t count = from_environment("REDAG_WAITS_COUNT").value_or(150);
  std::uint64_t waits = 0;
  for (std::uint64_t seed = first; seed < first + count; ++seed) {
    Rng rng(seed);
    trace::RunInfo info;
    info.executor = "redag";
    info.workload = random_workload(rng);
    add_waits(rng, info.workload);
    info.config = random_config(rng, policy, preemption, info.workload.task_count());
    info.workload.policy = policy;
    info.workload.ties = info.config.ties;
    info.workload.platform.workers = info.config.workers;
    info.preemption = trace::preemption_name(preemption);
    info.seed = seed;
    info.end = 300 * kMicrosecond;
    const std::string replay =
        fmt::format("{}replay: REDAG_WAITS_SEED={} REDAG_WAITS_COUNT=1", describe(info.workload, info.config), seed);

    sched::PriorityScheduler tested(info.workload, info.config);
    const trace::Trace trace = simulated(info, tested);
    const metrics::CheckReport report = metrics::check_trace(trace);
    ASSERT_TRUE(report.ok()) << report.to_string() << replay;
    ReferenceScheduler expected(info.workload, info.config);
    ASSERT_EQ(jobs_of(trace), jobs_of(simulated(info, expected))) << replay;
    for (const metrics::JobRecord &job : jobs_of(trace)) {
      if (job.outcome != metrics::JobOutcome::Finished) continue;
      ASSERT_EQ(job.split.sum(), job.response()) << replay;
      ASSERT_EQ(job.split[metrics::Stay::OnWorker], job.on_worker) << replay;
      for (const Duration length : job.split.length) ASSERT_GE(length, 0) << replay;
    }
    for (const JobEvent &event : trace.events) waits += event.kind == JobEventKind::Served ? 1U : 0U;
  }
  EXPECT_GT(waits, count) << "devices hardly served anything";
}

std::string name_of(const ::testing::TestParamInfo<SimulatedWaits::ParamType> &info) {
  constexpr const char *kModes[] = {"none", "cooperative", "full"};
  return fmt::format("{}_{}", to_string(std::get<0>(info.param)), kModes[static_cast<int>(std::get<1>(info.param))]);
}

INSTANTIATE_TEST_SUITE_P(
    All, SimulatedWaits,
    ::testing::Combine(::testing::Values(PolicyKind::RateMonotonic, PolicyKind::DeadlineMonotonic, PolicyKind::Fixed,
                                         PolicyKind::Edf, PolicyKind::Fifo, PolicyKind::ChainAware),
                       ::testing::Values(Preemption::None, Preemption::Cooperative, Preemption::Full)),
    name_of);

}  // namespace
}  // namespace redag::testing
