// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/threads/parker.hpp"

#include <gtest/gtest.h>

#include <thread>

#include "redag/threads/clock.hpp"

namespace redag::runtime {
namespace {

TEST(Parker, ATokenGivenEarlyIsNotLostAndSeveralAreOne) {
  Parker parker;
  parker.unpark();
  parker.unpark();
  parker.park();
  EXPECT_FALSE(parker.park_until(monotonic_now() + kMillisecond));
}

TEST(Parker, TimesOutNotBeforeTheDeadline) {
  Parker parker;
  const Time deadline = monotonic_now() + 2 * kMillisecond;
  EXPECT_FALSE(parker.park_until(deadline));
  EXPECT_GE(monotonic_now(), deadline);
  EXPECT_FALSE(parker.park_until(-1));  // a deadline in the distant past
}

TEST(Parker, NoWakeUpIsLostBetweenTwoThreads) {
  Parker ping;
  Parker pong;
  constexpr int kRounds = 20'000;
  int shared = 0;  // posted to and fro: the parkers order the accesses
  std::thread other([&] {
    for (int i = 0; i < kRounds; ++i) {
      ping.park();
      ++shared;
      pong.unpark();
    }
  });
  for (int i = 0; i < kRounds; ++i) {
    ++shared;
    ping.unpark();
    if (i % 2 == 0) {
      pong.park();
    } else {
      ASSERT_TRUE(pong.park_until(kNever));
    }
  }
  other.join();
  EXPECT_EQ(shared, 2 * kRounds);
}

TEST(Event, ReleasesEveryWaiterNowAndLater) {
  Event event;
  EXPECT_FALSE(event.wait_until(monotonic_now() + kMillisecond));
  std::thread a([&] { event.wait(); });
  std::thread b([&] { EXPECT_TRUE(event.wait_until(kNever)); });
  event.set();
  a.join();
  b.join();
  event.wait();
  EXPECT_TRUE(event.wait_until(0));
}

}  // namespace
}  // namespace redag::runtime
