// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/sched/ready_queue.hpp"

#include <algorithm>
#include <set>
#include <vector>

#include <gtest/gtest.h>

#include "redag/derived/rng.hpp"

namespace redag::sched {
namespace {

// Compares both queues with an ordered set of the same jobs: random pushes, removals of any job, removals of the first.
template <class Queue>
Queue make_queue(std::size_t levels);
template <>
LevelQueue make_queue<LevelQueue>(std::size_t levels) {
  return LevelQueue(levels);
}
template <>
HeapQueue make_queue<HeapQueue>(std::size_t) {
  return {};
}

void push(LevelQueue &queue, std::vector<Job> &jobs, std::uint32_t slot) {
  queue.push(jobs, slot, static_cast<std::uint32_t>(jobs[slot].key));
}
void push(HeapQueue &queue, std::vector<Job> &jobs, std::uint32_t slot) { queue.push(jobs, slot); }

template <class Queue>
class ReadyQueueTest : public ::testing::Test {};
using Queues = ::testing::Types<LevelQueue, HeapQueue>;
TYPED_TEST_SUITE(ReadyQueueTest, Queues);

TYPED_TEST(ReadyQueueTest, AgreesWithAnOrderedSet) {
  for (const std::size_t levels : {1U, 3U, 64U, 65U, 5'000U, 20'000U}) {
    Rng rng(levels);
    std::vector<Job> jobs(2 * levels + 10);
    for (std::size_t i = 0; i < jobs.size(); ++i) {
      jobs[i].key = rng.uniform(0, static_cast<std::int64_t>(levels) - 1);
      jobs[i].turn = rng.uniform(0, 3);
      jobs[i].rank = static_cast<std::uint32_t>(rng.uniform(0, 3));
      jobs[i].sequence = i;
    }
    const auto order = [&](std::uint32_t a, std::uint32_t b) { return before(jobs[a], jobs[b]); };
    std::set<std::uint32_t, decltype(order)> expected(order);
    TypeParam queue = make_queue<TypeParam>(levels);
    ASSERT_EQ(queue.top(), kNil);
    for (int step = 0; step < 20'000; ++step) {
      const auto slot = static_cast<std::uint32_t>(rng.uniform(0, static_cast<std::int64_t>(jobs.size()) - 1));
      if (rng.uniform01() < 0.3 && !expected.empty()) {
        queue.remove(jobs, *expected.begin());
        expected.erase(expected.begin());
      } else if (expected.contains(slot)) {
        queue.remove(jobs, slot);
        expected.erase(slot);
      } else {
        push(queue, jobs, slot);
        expected.insert(slot);
      }
      ASSERT_EQ(queue.top(), expected.empty() ? kNil : *expected.begin()) << "levels " << levels << " step " << step;
    }
  }
}

TEST(LevelBitmap, FindsTheSmallestMemberAtEverySize) {
  for (const std::uint32_t size : {1U, 63U, 64U, 65U, 4'096U, 4'097U, 262'145U}) {
    LevelBitmap bitmap(size);
    EXPECT_TRUE(bitmap.empty());
    for (const std::uint32_t member : {size - 1, size / 2, std::uint32_t{0}}) {
      bitmap.set(member);
      EXPECT_EQ(bitmap.first(), member);
    }
    bitmap.clear(0);
    if (size > 1) {
      EXPECT_EQ(bitmap.first(), size / 2);
    }
  }
}

}  // namespace
}  // namespace redag::sched
