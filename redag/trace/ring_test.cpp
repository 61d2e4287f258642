// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/trace/ring.hpp"

#include <gtest/gtest.h>

#include <array>
#include <thread>

namespace redag::trace {
namespace {

JobEvent numbered(std::uint32_t number) {
  JobEvent event;
  event.time = number;
  event.job = number;
  event.value = -static_cast<std::int64_t>(number);
  return event;
}

TEST(Ring, CapacityIsTheNextPowerOfTwo) {
  EXPECT_EQ(Ring(0).capacity(), 2U);
  EXPECT_EQ(Ring(5).capacity(), 8U);
  EXPECT_EQ(Ring(1024).capacity(), 1024U);
}

TEST(Ring, KeepsOrderAcrossTheWrap) {
  Ring ring(4);
  std::array<JobEvent, 3> out;
  std::uint32_t next_in = 0;
  std::uint32_t next_out = 0;
  for (int round = 0; round < 10; ++round) {
    for (int i = 0; i < 3; ++i) EXPECT_TRUE(ring.push(numbered(next_in++)));
    ASSERT_EQ(ring.pop(out), 3U);
    for (const JobEvent &event : out) EXPECT_EQ(event, numbered(next_out++));
  }
  EXPECT_EQ(ring.pop(out), 0U);
  EXPECT_EQ(ring.dropped(), 0U);
}

TEST(Ring, DropsTheNewestWhenFullAndCountsIt) {
  Ring ring(4);
  for (std::uint32_t i = 0; i < 6; ++i) EXPECT_EQ(ring.push(numbered(i)), i < 4);
  EXPECT_EQ(ring.dropped(), 2U);
  EXPECT_EQ(ring.pushed(), 4U);
  std::vector<JobEvent> all;
  EXPECT_EQ(ring.drain(all), 4U);
  EXPECT_EQ(all.back(), numbered(3));
  EXPECT_TRUE(ring.push(numbered(9)));  // there is room again
}

TEST(Ring, PopTakesAtMostWhatFits) {
  Ring ring(8);
  for (std::uint32_t i = 0; i < 5; ++i) ring.push(numbered(i));
  std::array<JobEvent, 2> out;
  EXPECT_EQ(ring.pop(out), 2U);
  EXPECT_EQ(out[1], numbered(1));
  std::vector<JobEvent> rest;
  EXPECT_EQ(ring.drain(rest), 3U);
  EXPECT_EQ(rest.front(), numbered(2));
}

// Every accepted event arrives once, complete and in order, at any pace of the reader. Under TSan this also shows that
// the indices alone hand over the slots.
TEST(Ring, TwoThreadsLoseNothingThatWasAccepted) {
  constexpr std::uint32_t kCount = 200'000;
  Ring ring(256);
  std::vector<std::uint32_t> accepted;
  accepted.reserve(kCount);
  std::atomic<bool> done{false};
  std::thread producer([&] {
    for (std::uint32_t i = 0; i < kCount; ++i) {
      if (ring.push(numbered(i))) accepted.push_back(i);
      if (i % 512 == 0) std::this_thread::yield();
    }
    done.store(true, std::memory_order_release);
  });
  std::vector<JobEvent> received;
  bool last = false;
  while (!last) {
    last = done.load(std::memory_order_acquire);
    if (ring.drain(received) == 0) std::this_thread::yield();
  }
  producer.join();

  ASSERT_EQ(received.size(), accepted.size());
  for (std::size_t i = 0; i < received.size(); ++i) ASSERT_EQ(received[i], numbered(accepted[i]));
  EXPECT_EQ(ring.pushed(), accepted.size());
  EXPECT_EQ(ring.pushed() + ring.dropped(), kCount);
}

}  // namespace
}  // namespace redag::trace
