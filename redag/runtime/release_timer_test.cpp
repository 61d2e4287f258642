// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/runtime/release_timer.hpp"

#include <gtest/gtest.h>
#include <array>

#include "redag/threads/clock.hpp"
#include "tests/testing/builders.hpp"

namespace redag::runtime {
namespace {

Dag one_timer(Duration period) { return testing::tick_dag("d", {{"t", period}}); }

struct Collector {
  std::vector<Release> releases;
  Event enough;
  std::size_t wanted = 0;

  ReleaseTimer::Sink sink() {
    return [this](std::span<const Release> batch) {
      releases.insert(releases.end(), batch.begin(), batch.end());
      if (wanted > 0 && releases.size() >= wanted) enough.set();
    };
  }
};

TEST(ReleaseTimer, ReportsExactlyTheGridUpToTheHorizon) {
  Collector collector;
  collector.wanted = 20;
  ReleaseTimer timer(collector.sink(), 1);
  timer.add(one_timer(kMillisecond), std::array{TaskId(0)}, 0);
  ASSERT_TRUE(timer.start(monotonic_now(), 20 * kMillisecond, {}));
  collector.enough.wait();
  timer.stop();
  timer.join();
  ASSERT_EQ(collector.releases.size(), 20U);
  for (std::size_t k = 0; k < 20; ++k) {
    EXPECT_EQ(collector.releases[k].nominal, static_cast<Time>(k) * kMillisecond);
  }
}

// The thread never catches up.
TEST(ReleaseTimer, EndsAlthoughMoreReleasesAreDue) {
  Event begun;
  ReleaseTimer timer([&](std::span<const Release>) { begun.set(); }, 1);
  timer.add(one_timer(1), std::array{TaskId(0)}, 0);
  ASSERT_TRUE(timer.start(monotonic_now(), kNever, {}));
  begun.wait();
  timer.stop();
  timer.join();
}

TEST(ReleaseTimer, AnEarlierReleaseAddedLaterWakesIt) {
  Collector collector;
  collector.wanted = 1;
  ReleaseTimer timer(collector.sink(), 1);
  const Time origin = monotonic_now();
  ASSERT_TRUE(timer.start(origin, kNever, {}));  // nothing to do: sleeps without end
  timer.add(one_timer(3600 * kSecond), std::array{TaskId(4)}, monotonic_now() - origin);
  collector.enough.wait();
  timer.stop();
  timer.join();
  ASSERT_EQ(collector.releases.size(), 1U);
  EXPECT_EQ(collector.releases[0].task, TaskId(4));
}

TEST(ReleaseTimer, WhatIsDueAtTheStopIsReported) {
  Collector collector;
  ReleaseTimer timer(collector.sink(), 1);
  timer.add(one_timer(kMillisecond), std::array{TaskId(0)}, 0);
  timer.stop();
  ASSERT_TRUE(timer.start(monotonic_now() - 10 * kSecond, 10 * kSecond, {}));
  timer.join();
  EXPECT_EQ(collector.releases.size(), 10'000U);
}

// The thread is created first, and waits for begin(), which cannot fail.
TEST(ReleaseTimer, ReleasesNothingBeforeItBegins) {
  Collector collector;
  collector.wanted = 1;
  ReleaseTimer timer(collector.sink(), 1);
  timer.add(one_timer(kMillisecond), std::array{TaskId(0)}, 0);
  ASSERT_TRUE(timer.start(ThreadSetup{}));
  ASSERT_TRUE(timer.start(ThreadSetup{})) << "there is one already";
  EXPECT_FALSE(collector.enough.wait_until(monotonic_now() + 20 * kMillisecond));
  const Time origin = monotonic_now();
  timer.begin(origin, kNever);
  collector.enough.wait();
  EXPECT_GE(monotonic_now(), origin);
  timer.stop();
  timer.join();
  EXPECT_EQ(collector.releases[0].nominal, 0);
}

TEST(ReleaseTimer, OtherThreadsReleaseWhatIsDue) {
  Collector collector;
  ReleaseTimer timer(collector.sink(), 1);
  timer.add(one_timer(3600 * kSecond), std::array{TaskId(0)}, kMillisecond);
  EXPECT_EQ(timer.release_due(), kNever) << "it has not begun";
  EXPECT_TRUE(collector.releases.empty());
  const Time origin = monotonic_now() - kSecond;
  timer.begin(origin, kNever);
  EXPECT_EQ(timer.release_due(), origin + kMillisecond + 3600 * kSecond);
  EXPECT_EQ(timer.release_due(), origin + kMillisecond + 3600 * kSecond);
  EXPECT_EQ(collector.releases.size(), 1U) << "each release comes once";
}

TEST(ReleaseTimer, OtherThreadsKnowTheHorizon) {
  Collector collector;
  ReleaseTimer timer(collector.sink(), 1);
  timer.add(one_timer(kMillisecond), std::array{TaskId(0)}, 0);
  timer.begin(monotonic_now() - kSecond, 5 * kMillisecond);
  EXPECT_EQ(timer.release_due(), kNever);
  EXPECT_EQ(collector.releases.size(), 5U);
}

TEST(ReleaseTimer, OtherThreadsReleaseNothingAfterItsEnd) {
  Collector collector;
  ReleaseTimer timer(collector.sink(), 1);
  ASSERT_TRUE(timer.start(monotonic_now(), kNever, {}));
  timer.stop();
  timer.join();
  timer.add(one_timer(3600 * kSecond), std::array{TaskId(0)}, 0);
  EXPECT_EQ(timer.release_due(), kNever);
  EXPECT_TRUE(collector.releases.empty());
}

TEST(ReleaseTimer, AThreadThatCannotBeSetUpIsAnError) {
  ReleaseTimer timer([](auto) {}, 1);
  EXPECT_FALSE(timer.start(0, kNever, ThreadSetup{"t", 0, {1023}}));
}

}  // namespace
}  // namespace redag::runtime
