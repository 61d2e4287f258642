// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Bounds are computed in nanoseconds. The other tests draw times of a few ticks, where an iteration of one tick a step
// ends soon. Here the same workloads have a tick of 100 ns or a millisecond, or ticks so long that sums approach the
// longest duration.
#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <set>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "redag_analysis/analyze/executors.hpp"
#include "tests/testing/bound_property.hpp"
#include "tests/testing/random_workloads.hpp"

namespace redag::analysis {
namespace {

testing::BoundCase with_tick(testing::BoundCase bound_case, Duration tick) {
  for (Dag &dag : bound_case.workload.dags) {
    dag.deadline *= tick;
    for (Task &task : dag.tasks) {
      for (Duration *time : {&task.period, &task.deadline, &task.wcet, &task.wcet_low, &task.bcet, &task.offset,
                             &task.jitter, &task.region}) {
        *time *= tick;
      }
      for (Wait &wait : task.waits) {
        for (Duration *time : {&wait.after, &wait.longest, &wait.shortest}) *time *= tick;
      }
    }
  }
  for (Duration *time : {&bound_case.platform.release_overhead, &bound_case.platform.dispatch_overhead,
                         &bound_case.platform.preempt_overhead}) {
    *time *= tick;
  }
  return bound_case;
}

struct Count {
  std::uint64_t coarse = 0;  // bounds
  std::uint64_t fine = 0;
};

std::uint64_t bounded(const Method &method, const TaskSet &task_set) {
  const Outcome outcome = task_set.not_analysable.empty() ? method.apply(task_set) : Outcome(NotApplicable{});
  const auto *bound = std::get_if<Bound>(&outcome);
  if (bound == nullptr) return 0;
  return static_cast<std::uint64_t>(std::count_if(bound->tasks.begin(), bound->tasks.end(),
                                                  [](const ResponseBound &task) { return task.response.has_value(); }));
}

void count(const testing::BoundCaseLimits &limits, std::map<std::string, Count> &counts) {
  for (std::uint64_t seed = 0; seed < 60; ++seed) {
    Rng rng(seed);
    const testing::BoundCase drawn = random_bound_case(rng, limits);
    const testing::BoundCase coarse = with_tick(drawn, 100);
    const testing::BoundCase fine = with_tick(drawn, kMillisecond);
    for (const char *name : {"redag", "ste", "mte"}) {
      const executors::ExecutorKind &executor = *executors::find_executor(name);
      const auto before = compile_for(executor, coarse.workload, coarse.platform);
      const auto after = compile_for(executor, fine.workload, fine.platform);
      ASSERT_TRUE(before && after);
      for (const Method &method : methods_of(executor)) {
        Count &of = counts[std::string(method.name)];
        of.coarse += bounded(method, *before);
        of.fine += bounded(method, *after);
      }
    }
  }
}

// Few tasks and workers: steps are shortest where the other tasks are as many as the workers.
TEST(FinerClock, LosesFewBounds) {
  std::map<std::string, Count> counts;
  for (const auto preemption : {sched::Preemption::Full, sched::Preemption::None}) {
    for (const PolicyKind policy : {PolicyKind::RateMonotonic, PolicyKind::Edf}) {
      for (const bool edges : {false, true}) {
        testing::BoundCaseLimits limits;
        limits.max_workers = 3;
        limits.preemption = preemption;
        limits.policies = {policy};
        limits.edges = edges;
        limits.max_dags = 4;
        limits.max_utilization = 0.6;
        limits.min_utilization = 0.1;
        limits.max_period = 120;
        count(limits, counts);
      }
    }
  }
  std::size_t compared = 0;
  for (const auto &[name, of] : counts) {
    if (of.coarse < 20) continue;
    ++compared;
    // Some bounds are lost: with coarse ticks, more is lost where a sum is divided by the workers and rounded down.
    EXPECT_GE(of.fine * 100, of.coarse * 98) << name << ": " << of.fine << " of " << of.coarse;
  }
  EXPECT_GE(compared, 15U);
}

// Ticks of a quarter of an hour, and of eleven days.
class CoarserClock : public ::testing::TestWithParam<const Method *> {};

TEST_P(CoarserClock, NoBoundIsBroken) {
  const Method &method = *GetParam();
  std::uint64_t bounds = 0;
  for (const Duration tick : {Duration{1'000'000'000'000}, Duration{1'000'000'000'000'000}}) {
    for (const auto preemption : {sched::Preemption::Full, sched::Preemption::Cooperative, sched::Preemption::None}) {
      for (const auto &[workers, edges] : {std::pair{1U, false}, {1U, true}, {3U, false}, {3U, true}}) {
        testing::BoundCaseLimits limits;
        limits.min_workers = limits.max_workers = workers;
        limits.preemption = preemption;
        limits.policies.push_back(PolicyKind::Edf);
        limits.edges = limits.rates = edges;
        limits.jitter = limits.caps = true;
        limits.max_dags = 4;
        limits.max_utilization = 0.8;
        const auto generator = [&](Rng &rng) {
          testing::BoundCase drawn = random_bound_case(rng, limits);
          if (method.name.starts_with("suspension_aware")) testing::add_waits(rng, drawn.workload);
          return with_tick(std::move(drawn), tick);
        };
        const testing::BoundPropertyResult result = testing::check_bound(
            method, generator, {.workloads = 25, .runs = 3, .periods = 5, .keeps_grids = method.name == "offsets"});
        EXPECT_EQ(result.violations, 0U) << result.first_violation;
        bounds += result.bounds;
      }
    }
  }
  // These need criticalities or groups.
  const std::set<std::string_view> silent = {"amc_rtb", "dag_groups"};
  EXPECT_EQ(bounds == 0, silent.count(method.name) == 1) << bounds;
}

std::vector<const Method *> all_methods() {
  std::vector<const Method *> all;
  for (const Method &method : methods()) all.push_back(&method);
  return all;
}

INSTANTIATE_TEST_SUITE_P(Methods, CoarserClock, ::testing::ValuesIn(all_methods()),
                         [](const auto &method) { return std::string(method.param->name); });

}  // namespace
}  // namespace redag::analysis
