// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The bounds of analyze() where features are mixed: each holds, and a feature of one task takes no bound from tasks
// that it cannot delay.
#include <gtest/gtest.h>

#include <map>
#include <string>

#include "redag/derived/clusters.hpp"
#include "redag/loader/workload_yaml.hpp"
#include "redag_analysis/analyze/analyze.hpp"
#include "redag_analysis/analyze/executors.hpp"
#include "redag_analysis/any_features/by_demand.hpp"
#include "tests/testing/bound_property.hpp"
#include "tests/testing/random_workloads.hpp"
#include "tests/testing/repository.hpp"

namespace redag::analysis {
namespace {

using testing::BoundCase;

Report analysed(const TaskSet &task_set) { return analyze(task_set); }

// `keeps_grids`: timers keep their periods and offsets.
Method whole_analysis(bool keeps_grids) {
  return Method{.name = "analyze",
                .cite = "",
                .assumptions = "",
                .complexity = "",
                .knows_waits = true,
                .apply = [keeps_grids](TaskSet task_set) -> Outcome {
                  for (Unit &unit : task_set.units) unit.keeps_grid = unit.keeps_grid && keeps_grids;
                  return tightest_of(analysed(task_set));
                }};
}

// Draws workloads with every feature that a bound covers, and some that none does.
testing::BoundGenerator mixed(std::uint32_t workers, sched::Preemption preemption) {
  testing::BoundCaseLimits limits;
  limits.max_workers = workers;
  limits.preemption = preemption;
  limits.edges = true;
  limits.max_dags = 4;
  limits.max_tasks = 4;
  limits.jitter = true;
  limits.min_utilization = 0.1;
  limits.max_utilization = 0.8;
  limits.max_deadline = 1.5;
  return [limits](Rng &rng) {
    testing::BoundCaseLimits drawn = limits;
    drawn.rates = testing::chance(rng, 0.5);
    drawn.groups = testing::chance(rng, 0.3);
    drawn.caps = testing::chance(rng, 0.3);
    drawn.levels = testing::chance(rng, 0.2);
    drawn.queues = testing::chance(rng, 0.3);
    BoundCase bound_case = testing::random_bound_case(rng, drawn);
    if (testing::chance(rng, 0.4)) testing::add_waits(rng, bound_case.workload);
    for (Dag &dag : bound_case.workload.dags) {
      for (Task &task : dag.tasks) {
        if (task.group.empty() && testing::chance(rng, 0.05)) task.concurrency = 2;
      }
    }
    return bound_case;
  };
}

TEST(BoundProperty, OfMixedFeatures) {
  using sched::Preemption;
  for (const std::uint32_t workers : {1U, 3U}) {
    for (const Preemption preemption : {Preemption::Full, Preemption::None, Preemption::Cooperative}) {
      const std::uint32_t count = preemption == Preemption::Full ? 600 : 150;
      for (const bool keeps_grids : {false, true}) {
        testing::expect_bound_holds(whole_analysis(keeps_grids), mixed(workers, preemption),
                                    {.workloads = count, .keeps_grids = keeps_grids, .include_refused = true});
      }
    }
  }
}

TEST(BoundProperty, ByDemandOfMixedFeatures) {
  using sched::Preemption;
  for (const std::uint32_t workers : {1U, 3U}) {
    for (const Preemption preemption : {Preemption::Full, Preemption::None, Preemption::Cooperative}) {
      testing::expect_bound_holds(by_demand(), mixed(workers, preemption), {.workloads = 200, .include_refused = true});
    }
  }
}

// The share of tasks with a bound is known, so that no change takes some away unnoticed.
TEST(Composition, MostTasksOfMixedFeaturesHaveABound) {
  std::uint64_t tasks = 0;
  std::uint64_t bounded = 0;
  for (std::uint64_t seed = 0; seed < 300; ++seed) {
    Rng rng(mix(seed));
    const BoundCase bound_case = mixed(3, sched::Preemption::Full)(rng);
    for (const Tightest &task : analysed(testing::compiled(bound_case)).tasks) {
      ++tasks;
      bounded += task.response ? 1U : 0U;
    }
  }
  EXPECT_GT(bounded * 100, tasks * 35) << bounded << " of " << tasks;
}

struct Case {
  std::string file;
  std::map<std::string, Duration> most;  // in microseconds
};

Workload read(const std::string &file) {
  const auto loaded = load_workload(testing::repository() / "tests/cases" / (file + ".yaml"), {.waits = true});
  EXPECT_TRUE(loaded) << file;
  return loaded ? loaded->workload : Workload{};
}

TEST(Composition, PublishedAndReportedCases) {
  const Case cases[] = {
      {"chain_head", {{"head.read", 1000}, {"head.work", 16'000}, {"head", 16'000}}},
      {"handlers", {{"a", 4000}, {"a.isr", 2000}, {"b.isr", 2000}, {"b", 19'000}}},
      // M. Harbour, M. Klein, J. Lehoczky, Fixed priority scheduling of periodic tasks with varying execution priority,
      // RTSS 1991.
      {"varying_priorities", {{"t1", 28'000}, {"t2", 98'000}, {"t3", 47'000}, {"t4", 195'000}, {"t5", 223'000}}},
      // The second processor of a chain over CPU, bus and CPU: the jitter of T32 exceeds its period.
      {"jitter_above_period", {{"cpu2.T31", 28'000}, {"cpu2.T32", 22'000}}},
      {"wait_below", {{"x.fast", 14'000}, {"x.slow", 149'000}}},
      // One job of b, started an instant before, holds what a needs.
      {"two_resources", {{"x.a", 4000}, {"x.b", 4000}}},
      // N. Audsley, University of York YCS 164, 1991. Exact: the schedule repeats.
      {"offsets", {{"x.A", 1000}, {"x.B", 2000}, {"x.C", 6000}, {"x.D", 9000}, {"x.E", 13'000}, {"x.F", 30'000}}},
      // The other core's longest request can be ahead: 4 + 8 + 116 + 1 ms.
      {"gpu_of_two_clusters", {{"detection.detection", 129'000}}},
      {"robot", {{"joints.controller", 400}, {"state.ekf", 800}, {"vision.camera", 2700}, {"vision", 32'200}}},
  };
  for (const Case &one : cases) {
    std::map<std::string, std::optional<Duration>> found;
    for (const ClusterPart &part : parts_of(read(one.file))) {
      const TaskSet task_set = testing::compiled(part.workload);
      const Report report = analysed(task_set);
      for (std::size_t t = 0; t < task_set.tasks.size(); ++t) found[task_set.tasks[t].name] = report.tasks[t].response;
      for (std::size_t d = 0; d < task_set.dags.size(); ++d) found[task_set.dags[d].name] = report.dags[d].response;
    }
    for (const auto &[name, most] : one.most) {
      ASSERT_TRUE(found.at(name)) << one.file << ": " << name;
      EXPECT_EQ((*found.at(name) + 999) / 1000, most) << one.file << ": " << name;
    }
  }
}

// Of the unit a, b, c only a and b are more urgent than c, which no method but the last resort covers. They do not wait
// for each other, and can keep two workers busy at once.
TEST(Composition, APartOfAUnitIsNoTask) {
  const auto loaded = parse_workload(R"(
platform: {workers: 3, preemption: os}
policy: fixed
ties: fixed
dags:
  - name: d
    tasks:
      - {name: a, wcet: 2ms, period: 18ms, priority: 4}
      - {name: b, wcet: 1ms, period: 18ms, priority: 4}
      - {name: c, wcet: 3ms, activation: data, after: [a, b], priority: 1, concurrency: 2}
  - name: e
    tasks:
      - {name: x, wcet: 1ms, period: 14ms, priority: 3}
      - {name: y, wcet: 6ms, period: 14ms, priority: 2}
)",
                                     "unit.yaml");
  ASSERT_TRUE(loaded) << to_string(loaded.error());
  const TaskSet task_set = testing::compiled(loaded->workload);
  const Tightest y = analysed(task_set).tasks[4];
  ASSERT_TRUE(y.response);
  EXPECT_EQ(*y.response, 7 * kMillisecond);
}

// The bounds of any order see that the jobs of a chain follow each other.
TEST(Composition, ChainsOnTwoThreadsOfTheMultiThreadedExecutor) {
  const Workload workload = read("mte_chains");
  const executors::ExecutorKind &mte = *executors::find_executor("mte");
  const auto task_set = compile_for(mte, workload, platform_of(workload));
  ASSERT_TRUE(task_set) << to_string(task_set.error());
  const Report report = analyze(*task_set, methods_of(mte));
  const Duration most[] = {58'200, 72'300, 58'200};  // microseconds
  for (std::size_t d = 0; d < 3; ++d) EXPECT_EQ(report.dags[d].response.value_or(0) / kMicrosecond, most[d]);
}

}  // namespace
}  // namespace redag::analysis
