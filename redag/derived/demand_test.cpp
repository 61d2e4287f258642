// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/derived/demand.hpp"

#include <algorithm>
#include <cmath>
#include <set>

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

namespace redag {
namespace {

using TimeKind = ExecutionTime::Kind;

Task task_of(TimeKind kind, Duration bcet, Duration wcet) {
  Task task;
  task.bcet = bcet;
  task.wcet = wcet;
  task.period = 1'000'000;
  task.execution.kind = kind;
  return task;
}

TEST(ExecutionTime, ConstantIsTheWcet) {
  EXPECT_EQ(execution_time(task_of(TimeKind::Constant, 0, 500), TaskId(3), 7, 1), 500);
}

RC_GTEST_PROP(ExecutionTime, StaysBetweenBcetAndWcet, (std::uint64_t seed, std::uint32_t number)) {
  const auto wcet = *rc::gen::inRange<Duration>(1, 1'000'000'000);
  const auto bcet = *rc::gen::inRange<Duration>(0, wcet + 1);
  Task task = task_of(*rc::gen::element(TimeKind::Uniform, TimeKind::Normal), bcet, wcet);
  task.execution.mean = *rc::gen::inRange<Duration>(std::max<Duration>(1, bcet), wcet + 1);
  task.execution.stddev = *rc::gen::inRange<Duration>(0, 2 * wcet);
  const Duration drawn = execution_time(task, TaskId(1), number, seed);
  RC_ASSERT(drawn >= std::max<Duration>(1, bcet));
  RC_ASSERT(drawn <= wcet);
}

TEST(ExecutionTime, EmpiricalDrawsEverySampleAndNothingElse) {
  Task task = task_of(TimeKind::Empirical, 0, 30);
  task.execution.samples = {10, 20, 30};
  std::set<Duration> seen;
  for (std::uint32_t k = 0; k < 100; ++k) seen.insert(execution_time(task, TaskId(0), k, 5));
  EXPECT_EQ(seen, (std::set<Duration>{10, 20, 30}));
}

TEST(ExecutionTime, NormalIsCentredOnItsMean) {
  Task task = task_of(TimeKind::Normal, 800, 1200);
  task.execution.mean = 1000;
  task.execution.stddev = 50;
  double sum = 0;
  for (std::uint32_t k = 0; k < 10'000; ++k) sum += static_cast<double>(execution_time(task, TaskId(0), k, 2));
  EXPECT_NEAR(sum / 10'000, 1000, 3);
}

TEST(ReleaseJitter, DoesNotChangeExecutionTimes) {
  Task task = task_of(TimeKind::Uniform, 1, 1'000'000);
  const Duration before = execution_time(task, TaskId(2), 9, 11);
  task.jitter = 500;
  EXPECT_EQ(execution_time(task, TaskId(2), 9, 11), before);
}

RC_GTEST_PROP(ReleaseJitter, IsBetweenZeroAndTheBound, (std::uint64_t seed, std::uint32_t number)) {
  Task task = task_of(TimeKind::Constant, 0, 10);
  task.jitter = *rc::gen::inRange<Duration>(0, 1'000'000);
  const Duration drawn = release_jitter(task, TaskId(4), number, seed);
  RC_ASSERT(drawn >= 0 && drawn <= task.jitter);
}

TEST(Demand, DependsOnSeedTaskAndNumber) {
  const Task task = task_of(TimeKind::Uniform, 1, 1'000'000'000);
  const Duration base = execution_time(task, TaskId(0), 0, 0);
  EXPECT_EQ(execution_time(task, TaskId(0), 0, 0), base);
  EXPECT_NE(execution_time(task, TaskId(1), 0, 0), base);
  EXPECT_NE(execution_time(task, TaskId(0), 1, 0), base);
  EXPECT_NE(execution_time(task, TaskId(0), 0, 1), base);
}

TEST(Demand, VariesWhereTwoJobsCanDiffer) {
  EXPECT_FALSE(demand_varies(task_of(TimeKind::Constant, 1, 500)));
  EXPECT_TRUE(demand_varies(task_of(TimeKind::Uniform, 1, 500)));
  EXPECT_FALSE(demand_varies(task_of(TimeKind::Uniform, 500, 500)));
  EXPECT_FALSE(demand_varies(task_of(TimeKind::Uniform, 0, 1)));  // never below 1 ns
  Task normal = task_of(TimeKind::Normal, 1, 500);
  EXPECT_FALSE(demand_varies(normal));
  normal.execution.stddev = 10;
  EXPECT_TRUE(demand_varies(normal));
  Task empirical = task_of(TimeKind::Empirical, 1, 500);
  empirical.execution.samples = {7, 7, 7};
  EXPECT_FALSE(demand_varies(empirical));
  empirical.execution.samples = {7, 7, 8};
  EXPECT_TRUE(demand_varies(empirical));
  Task late = task_of(TimeKind::Constant, 1, 500);
  late.jitter = 1;
  EXPECT_TRUE(demand_varies(late));
}

}  // namespace
}  // namespace redag
