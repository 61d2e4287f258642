// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The requirement on every driver: for every workload, policy and preemption mode the trace passes the checker.

#include <gtest/gtest.h>

#include "redag/derived/rng.hpp"
#include "redag/sched/policy.hpp"
#include "redag/threads/setup.hpp"
#include "redag_analysis/metrics/check/trace_checker.hpp"
#include "tests/testing/drivers.hpp"
#include "tests/testing/environment.hpp"
#include "tests/testing/random_workloads.hpp"

namespace redag::testing {
namespace {

// REDAG_SEED=<n> is the first seed, to replay a failure. REDAG_WORKLOADS=<n> is the number for each test, for a long
// run.
struct Combination {
  PolicyKind policy;
  sched::Preemption preemption;
};

class Conformance : public ::testing::TestWithParam<Combination> {
 protected:
  template <class Driver>
  void check(std::uint64_t workloads) {
    const std::uint64_t first = from_environment("REDAG_SEED").value_or(1);
    const std::uint64_t count = from_environment("REDAG_WORKLOADS").value_or(workloads);
    for (std::uint64_t seed = first; seed < first + count; ++seed) {
      RunSpec spec;
      Rng rng(seed);
      spec.workload = contended(rng);
      spec.workload.policy = GetParam().policy;
      if (seed % 3 == 0) add_waits(rng, spec.workload);
      spec.preemption = GetParam().preemption;
      spec.horizon = 200 * kMillisecond;
      spec.seed = seed;
      const trace::Trace trace = Driver::run(spec);
      const metrics::CheckReport report = metrics::check_trace(trace);
      ASSERT_TRUE(report.ok()) << "replay with REDAG_SEED=" << seed << " REDAG_WORKLOADS=1\n" << report.to_string();
    }
  }
};

// Real time is expensive: by default there are few workloads. Together they still cover every feature.
TEST_P(Conformance, Threads) {
  const bool os = GetParam().preemption == sched::Preemption::Full;
  if (os && !is_static(GetParam().policy)) GTEST_SKIP() << "os preemption needs a static policy";
  if (os && runtime::probe_priority_band().top_job == 0) GTEST_SKIP() << "no real-time rights";
  check<ThreadsDriver>(4);
}
TEST_P(Conformance, Simulator) { check<SimulatorDriver>(400); }
TEST_P(Conformance, ManualWorkers) { check<ManualDriver>(400); }

std::vector<Combination> combinations() {
  std::vector<Combination> all;
  for (const PolicyKind policy : {PolicyKind::RateMonotonic, PolicyKind::DeadlineMonotonic, PolicyKind::Fixed,
                                  PolicyKind::Edf, PolicyKind::Fifo, PolicyKind::ChainAware}) {
    for (const sched::Preemption preemption :
         {sched::Preemption::None, sched::Preemption::Cooperative, sched::Preemption::Full}) {
      all.push_back({policy, preemption});
    }
  }
  return all;
}

INSTANTIATE_TEST_SUITE_P(All, Conformance, ::testing::ValuesIn(combinations()), [](const auto &test) {
  return std::string(to_string(test.param.policy)) + "_" + trace::preemption_name(test.param.preemption);
});

}  // namespace
}  // namespace redag::testing
