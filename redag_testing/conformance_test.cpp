// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The requirement on every driver: for every workload, policy and preemption mode the trace passes the checker.
#include <cstdlib>

#include <gtest/gtest.h>

#include "redag/base/rng.hpp"
#include "redag/runtime/setup.hpp"
#include "redag/sched/policy.hpp"
#include "redag_analysis/metrics/trace_checker.hpp"
#include "redag_lab/workload/generate.hpp"
#include "redag_testing/drivers.hpp"

namespace redag::testing {
namespace {

// REDAG_SEED=<n> is the first seed, to replay a failure. REDAG_WORKLOADS=<n> is the number for each test, for a long
// run.
std::uint64_t from_environment(const char *name, std::uint64_t otherwise) {
  const char *text = std::getenv(name);
  return text == nullptr ? otherwise : std::strtoull(text, nullptr, 10);
}

// Small workloads with much contention that use every feature of the model.
Workload random_workload(std::uint64_t seed) {
  Rng rng(seed);
  lab::GenerateOptions options;
  options.dags = static_cast<std::uint32_t>(rng.uniform(1, 4));
  options.min_tasks = 1;
  options.max_tasks = static_cast<std::uint32_t>(rng.uniform(1, 7));
  options.workers = static_cast<std::uint32_t>(rng.uniform(1, 4));
  const double most = 0.9 * options.dags * options.min_tasks;
  options.utilization = std::min(most, (0.2 + 1.2 * rng.uniform01()) * options.workers);
  options.periods = lab::PeriodModel::Harmonic;
  options.period_max = 40 * kMillisecond;
  options.rates = rng.uniform01() < 0.5 ? lab::RateScope::PerDag : lab::RateScope::PerTask;
  options.shape = static_cast<lab::DagShape>(rng.uniform(0, 4));
  options.data_share = rng.uniform01();
  options.bcet_min = 0.2;
  options.jitter = rng.uniform01() < 0.3 ? 0.5 : 0.0;
  options.offsets = rng.uniform01() < 0.5;
  options.max_active_max = static_cast<std::uint32_t>(rng.uniform(0, 3));
  options.groups = static_cast<std::uint32_t>(rng.uniform(0, 2));
  options.group_share = options.groups > 0 ? 0.4 : 0.0;
  options.queue_share = rng.uniform01() < 0.5 ? 0.5 : 0.0;
  Result<Workload> workload = generate(options, seed);
  if (!workload) ADD_FAILURE() << to_string(workload.error());
  for (Dag &dag : workload->dags) {
    if (rng.uniform01() < 0.2) dag.max_pending = static_cast<std::uint32_t>(rng.uniform(1, 4));
    dag.criticality = static_cast<Criticality>(rng.uniform(0, 2));
    if (dag.criticality != Criticality::High) {
      dag.degrade.kind = static_cast<Degrade::Kind>(rng.uniform(0, 2));
      dag.degrade.skip = static_cast<std::uint32_t>(rng.uniform(1, 3));
      dag.degrade.stretch = 1 + 3 * rng.uniform01();
    }
    const bool has_modes = dag.criticality == Criticality::High && rng.uniform01() < 0.5;
    for (Task &task : dag.tasks) {
      if (has_modes && rng.uniform01() < 0.5) task.wcet_low = rng.uniform(1, task.wcet);
      if (rng.uniform01() < 0.2) {
        task.on_budget = static_cast<OnBudget>(rng.uniform(1, 3));
        task.budget = rng.uniform(1, task.wcet);
      }
      if (rng.uniform01() < 0.7) task.region = std::max<Duration>(1, task.wcet / rng.uniform(1, 5));
      if (task.budget == 0 && rng.uniform01() < 0.1) task.budget = std::max<Duration>(1, task.wcet / 2);
      if (task.group.empty() && rng.uniform01() < 0.1) task.concurrency = static_cast<std::uint32_t>(rng.uniform(2, 3));
      if (rng.uniform01() < 0.5) task.priority = static_cast<int>(rng.uniform(-2, 2));
    }
  }
  return *workload;
}

struct Combination {
  PolicyKind policy;
  sched::Preemption preemption;
};

class Conformance : public ::testing::TestWithParam<Combination> {
 protected:
  template <class Driver>
  void check(std::uint64_t workloads) {
    const std::uint64_t first = from_environment("REDAG_SEED", 1);
    const std::uint64_t count = from_environment("REDAG_WORKLOADS", workloads);
    for (std::uint64_t seed = first; seed < first + count; ++seed) {
      RunSpec spec;
      spec.workload = random_workload(seed);
      spec.workload.policy = GetParam().policy;
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
