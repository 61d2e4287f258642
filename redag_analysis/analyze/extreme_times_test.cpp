// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Every method on task sets with times between a nanosecond and the longest duration: no bound may result from a sum or
// product that wrapped. UndefinedBehaviorSanitizer (make asan) finds the wrap itself; these tests see only its results.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "redag/loader/validate.hpp"
#include "redag_analysis/analyze/analyze.hpp"
#include "redag_analysis/analyze/chains.hpp"
#include "redag_analysis/analyze/executors.hpp"
#include "redag_analysis/core/arithmetic.hpp"
#include "redag_lab/search/sensitivity.hpp"
#include "tests/testing/bound_property.hpp"

namespace redag::analysis {
namespace {

std::uint64_t cases_to_try() { return testing::how_many(3000); }

template <class Values>
auto any_of(Rng &rng, const Values &values) {
  return values[static_cast<std::size_t>(rng.uniform(0, static_cast<std::int64_t>(std::size(values)) - 1))];
}

// A time from a nanosecond to the longest, all magnitudes equally likely, or one of the extremes.
Duration any_time(Rng &rng) {
  constexpr std::array kEnds{Duration{1}, Duration{2}, kMaxDuration / 16, kMaxDuration / 2, kMaxDuration};
  if (rng.uniform(0, 2) == 0) return any_of(rng, kEnds);
  return static_cast<Duration>(std::exp(rng.uniform01() * std::log(static_cast<double>(kMaxDuration))));
}

testing::BoundCaseLimits any_limits(Rng &rng) {
  constexpr std::array kPolicies{PolicyKind::RateMonotonic, PolicyKind::DeadlineMonotonic,
                                 PolicyKind::Fixed,         PolicyKind::Edf,
                                 PolicyKind::Fifo,          PolicyKind::ChainAware};
  constexpr std::array kModes{sched::Preemption::None, sched::Preemption::Cooperative, sched::Preemption::Full};
  const auto now_and_then = [&] { return rng.uniform(0, 2) == 0; };
  testing::BoundCaseLimits limits;
  limits.max_workers = any_of(rng, std::array{1U, 3U, 80U});
  limits.preemption = any_of(rng, kModes);
  limits.policies = {any_of(rng, kPolicies)};
  limits.edges = now_and_then();
  limits.rates = limits.edges && now_and_then();
  limits.max_dags = 4;
  limits.jitter = now_and_then();
  limits.groups = now_and_then();
  limits.caps = now_and_then();
  limits.levels = now_and_then();
  limits.overheads = now_and_then();
  limits.queues = now_and_then();
  return limits;
}

// Multiplies all times by one factor, as far as they can grow, and replaces some by any time.
void stretch(Rng &rng, testing::BoundCase &drawn) {
  Duration longest = 1;
  for (const Dag &dag : drawn.workload.dags) {
    for (const Task &task : dag.tasks) longest = std::max({longest, task.period, task.deadline, task.offset});
  }
  const Duration factor = std::max<Duration>(1, any_time(rng) / longest);
  const auto change = [&](Duration &time) { time = rng.uniform(0, 9) == 0 ? any_time(rng) : time * factor; };
  for (Dag &dag : drawn.workload.dags) {
    if (dag.deadline > 0) change(dag.deadline);
    for (Task &task : dag.tasks) {
      for (Duration *time : {&task.period, &task.deadline, &task.wcet, &task.offset, &task.jitter, &task.region}) {
        if (*time > 0) change(*time);
      }
      task.bcet = std::min(std::max<Duration>(1, task.bcet * factor), task.wcet);
      task.wcet_low = std::min(task.wcet_low * factor, task.wcet);
      task.region = std::min(task.region, task.wcet);
      task.jitter = std::min(task.jitter, task.period);
    }
  }
}

testing::BoundCase any_case(Rng &rng) {
  testing::BoundCase drawn = random_bound_case(rng, any_limits(rng));
  stretch(rng, drawn);
  return drawn;
}

void expect_in_range(const std::vector<ResponseBound> &bounds, const Method &method) {
  for (const ResponseBound &bound : bounds) {
    if (!bound.response) continue;
    EXPECT_GT(*bound.response, 0) << method.name;
    EXPECT_LT(*bound.response, kUnbounded) << method.name;
  }
}

TEST(ExtremeTimes, NoBoundWraps) {
  std::uint64_t analysed = 0;
  std::uint64_t bounded = 0;
  for (std::uint64_t seed = 0; seed < cases_to_try() && !HasFailure(); ++seed) {
    SCOPED_TRACE(seed);
    Rng rng(seed);
    const testing::BoundCase drawn = any_case(rng);
    if (has_errors(validate(drawn.workload))) continue;
    for (const executors::ExecutorKind &executor : executors::all()) {
      const Result<TaskSet> task_set = compile_for(executor, drawn.workload, drawn.platform);
      if (!task_set || !task_set->not_analysable.empty()) continue;
      ++analysed;
      const Report report = analyze(*task_set, methods_of(executor));
      for (const MethodReport &method : report.methods) {
        if (method.bound() == nullptr) continue;
        expect_in_range(method.bound()->tasks, *method.method);
        expect_in_range(method.bound()->dags, *method.method);
      }
      std::vector<TaskId> chain;
      for (std::uint32_t task = 0; task < task_set->tasks.size(); ++task) {
        chain.emplace_back(task);
        bounded += report.tasks[task].response.has_value() ? 1U : 0U;
      }
      const auto end_to_end = chain_bound(*task_set, chain, tightest_of(report));
      if (const auto *bound = std::get_if<ChainBound>(&end_to_end)) {
        EXPECT_GT(bound->reaction(), 0);
        EXPECT_LE(bound->reaction(), kMaxDuration);
      }
    }
  }
  EXPECT_GT(analysed, cases_to_try() / 2);
  EXPECT_GT(bounded, cases_to_try() / 4);
}

// Adds devices, and to most tasks waits of any length.
void add_any_waits(Rng &rng, Workload &workload) {
  workload.platform.devices = {
      {"gpu", any_of(rng, std::array{1U, 2U, 4096U}), Device::Queue::Priority},
      {"dla", any_of(rng, std::array{1U, 3U}), Device::Queue::Fifo},
  };
  for (Dag &dag : workload.dags) {
    for (Task &task : dag.tasks) {
      if (task.wcet < 3) continue;
      const std::int64_t count = rng.uniform(0, 2);
      for (std::int64_t w = 1; w <= count; ++w) {
        const DeviceId device = any_of(rng, std::array{DeviceId(), DeviceId(std::size_t{0}), DeviceId(std::size_t{1})});
        const Duration longest = rng.uniform(0, 1) == 0 ? any_time(rng) : task.wcet;
        task.waits.push_back(Wait{w * (task.wcet / 3), longest, 0, device});
      }
    }
  }
}

TEST(ExtremeTimes, NoBoundOfTasksThatWaitWraps) {
  std::uint64_t analysed = 0;
  std::uint64_t bounded = 0;
  for (std::uint64_t seed = 0; seed < cases_to_try() && !HasFailure(); ++seed) {
    SCOPED_TRACE(seed);
    Rng rng(seed);
    testing::BoundCaseLimits limits = any_limits(rng);
    limits.preemption = any_of(rng, std::array{sched::Preemption::None, sched::Preemption::Full});
    limits.rates = limits.groups = limits.levels = limits.overheads = false;
    testing::BoundCase drawn = random_bound_case(rng, limits);
    stretch(rng, drawn);
    add_any_waits(rng, drawn.workload);
    const Result<TaskSet> task_set = compile(drawn.workload, drawn.platform);
    if (!task_set || !task_set->has_waits) continue;
    ++analysed;
    const Report report = analyze(*task_set);
    for (const MethodReport &method : report.methods) {
      if (method.bound() == nullptr) continue;
      expect_in_range(method.bound()->tasks, *method.method);
      expect_in_range(method.bound()->dags, *method.method);
      bounded += std::count_if(method.bound()->tasks.begin(), method.bound()->tasks.end(),
                               [](const ResponseBound &bound) { return bound.response.has_value(); }) > 0
                     ? 1U
                     : 0U;
    }
  }
  EXPECT_GT(analysed, cases_to_try() / 10);
  EXPECT_GT(bounded, cases_to_try() / 20);
}

TEST(ExtremeTimes, WhatSaturatedIsNoBound) {
  ResponseBound bound;
  bound.response = kUnbounded - 1;
  EXPECT_EQ(if_bounded(bound).response, kUnbounded - 1);
  bound.response = kUnbounded;
  EXPECT_FALSE(if_bounded(bound).response);
  EXPECT_FALSE(if_bounded(bound).absent.empty());
}

// The searches that analyse repeatedly with other times and orders.
TEST(ExtremeTimes, NoSearchWraps) {
  const std::uint64_t cases = std::max<std::uint64_t>(10, cases_to_try() / 30);
  std::uint64_t searched = 0;
  for (std::uint64_t seed = 0; seed < cases && !HasFailure(); ++seed) {
    SCOPED_TRACE(seed);
    Rng rng(seed);
    const testing::BoundCase drawn = any_case(rng);
    if (has_errors(validate(drawn.workload))) continue;
    const Result<TaskSet> task_set = compile(drawn.workload, drawn.platform);
    if (!task_set) continue;
    ++searched;
    int analyses = 0;
    const auto enough = [&analyses] { return ++analyses > 200; };
    for (const lab::Knob &knob : lab::knobs_of(drawn.workload)) {
      const auto margin = lab::margin_of(drawn.workload, drawn.platform, knob, lab::accepted_by_analysis, {4, enough});
      if (!margin) break;
    }
  }
  EXPECT_GT(searched, cases / 2);
}

}  // namespace
}  // namespace redag::analysis
