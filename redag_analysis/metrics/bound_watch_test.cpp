// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/metrics/bound_watch.hpp"

#include <gtest/gtest.h>

#include <vector>

namespace redag::metrics {
namespace {

JobEvent event(JobEventKind kind, std::uint32_t task, std::uint32_t job, Time value) {
  JobEvent result;
  result.kind = kind;
  result.task = TaskId(task);
  result.job = job;
  result.time = result.value = value;
  return result;
}

TEST(BoundWatch, CountsResponsesAboveTheBound) {
  int asked = 0;
  BoundWatch watch;
  const auto bound_of = [&](TaskId task) {
    ++asked;
    return task == TaskId(0) ? Duration{10} : Duration{0};
  };
  std::vector<BoundCount> told;
  const auto tell = [&](TaskId task, const BoundCount &count) {
    EXPECT_EQ(task, TaskId(0));
    told.push_back(count);
  };
  const std::vector<JobEvent> first = {
      event(JobEventKind::Finished, 0, 0, 90),  // released before the watch began
      event(JobEventKind::Released, 0, 1, 100), event(JobEventKind::Released, 1, 0, 100),
      event(JobEventKind::Finished, 0, 1, 110), event(JobEventKind::Released, 0, 2, 120)};
  const std::vector<JobEvent> second = {
      event(JobEventKind::Finished, 0, 2, 131), event(JobEventKind::Finished, 1, 0, 999),
      event(JobEventKind::Released, 0, 3, 140), event(JobEventKind::Skipped, 0, 3, 0),
      event(JobEventKind::Released, 0, 4, 150), event(JobEventKind::Finished, 0, 4, 175)};
  watch.add(first, bound_of, tell);
  EXPECT_TRUE(told.empty()) << "exactly the bound is no excess";
  watch.add(second, bound_of, tell);
  ASSERT_EQ(told.size(), 2U);
  EXPECT_EQ(told[0].worst, 11);
  ASSERT_NE(watch.of(TaskId(0)), nullptr);
  EXPECT_EQ(watch.of(TaskId(0))->exceeded, 2U);
  EXPECT_EQ(watch.of(TaskId(0))->worst, 25);
  EXPECT_EQ(watch.of(TaskId(1)), nullptr) << "has no bound";
  EXPECT_EQ(asked, 2) << "once a task";
}

}  // namespace
}  // namespace redag::metrics
