// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/runtime/release_heap.hpp"

#include <gtest/gtest.h>
#include <array>

#include "redag/derived/demand.hpp"
#include "tests/testing/builders.hpp"

namespace redag::runtime {
namespace {

Task timer(Duration period, Duration offset = 0, Duration jitter = 0) {
  return testing::tick_task({.period = period, .offset = offset, .jitter = jitter});
}

std::vector<Release> due(ReleaseHeap &heap, Time now, std::size_t room = 100) {
  std::vector<Release> out;
  out.reserve(room);
  heap.pop_due(now, out);
  return out;
}

TEST(ReleaseHeap, ReleasesOfOneInstantComeTogetherInTaskOrder) {
  ReleaseHeap heap(1);
  heap.add(timer(10), TaskId(1), 0);
  heap.add(timer(5), TaskId(0), 0);
  EXPECT_EQ(due(heap, 0).size(), 2U);
  EXPECT_EQ(heap.next(), 5);
  EXPECT_EQ(due(heap, 4).size(), 0U);
  EXPECT_EQ(due(heap, 5).size(), 1U);
  const auto both = due(heap, 10);
  ASSERT_EQ(both.size(), 2U);
  EXPECT_EQ(both[0].task, TaskId(0));
  EXPECT_EQ(both[1].task, TaskId(1));
}

TEST(ReleaseHeap, ALateCallReportsEveryGridPoint) {
  ReleaseHeap heap(1);
  heap.add(timer(10, 3), TaskId(0), 1000);
  const auto late = due(heap, 1045);
  ASSERT_EQ(late.size(), 5U);
  for (std::size_t k = 0; k < late.size(); ++k) EXPECT_EQ(late[k].nominal, 1003 + static_cast<Time>(k) * 10);
}

TEST(ReleaseHeap, WhatDoesNotFitComesNext) {
  ReleaseHeap heap(1);
  heap.add(timer(1), TaskId(0), 0);
  EXPECT_EQ(due(heap, 9, 4).size(), 4U);
  EXPECT_EQ(due(heap, 9, 4).size(), 4U);
  EXPECT_EQ(due(heap, 9, 4).size(), 2U);
}

TEST(ReleaseHeap, RemovedTasksAndDataTasksReleaseNothing) {
  ReleaseHeap heap(1);
  Task data = timer(10);
  data.activation = Activation::Data;
  heap.add(data, TaskId(0), 0);
  EXPECT_EQ(heap.next(), kNever);
  for (std::size_t t = 1; t < 6; ++t) heap.add(timer(10), TaskId(t), 0);
  heap.remove(std::array{TaskId(2), TaskId(3), TaskId(4)});
  const auto left = due(heap, 0);
  ASSERT_EQ(left.size(), 2U);
  EXPECT_EQ(left[0].task, TaskId(1));
  EXPECT_EQ(left[1].task, TaskId(5));
}

TEST(ReleaseHeap, JitterDelaysWhenAReleaseIsSeenAndNotItsNominalTime) {
  const Task task = timer(10, 0, 25);
  ReleaseHeap heap(7);
  heap.add(task, TaskId(3), 0);
  Time latest = 0;
  for (std::uint32_t k = 0; k < 200; ++k) {
    latest = std::max(latest, Time{10} * k + release_jitter(task, TaskId(3), k, 7));
    ASSERT_EQ(heap.next(), latest);  // a job never overtakes the one before it
    std::vector<Release> one;
    one.reserve(1);
    heap.pop_due(latest, one);
    ASSERT_EQ(one.size(), 1U);
    EXPECT_EQ(one[0].nominal, Time{10} * k);
  }
}

}  // namespace
}  // namespace redag::runtime
