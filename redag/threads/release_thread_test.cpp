// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/threads/release_thread.hpp"

#include <gtest/gtest.h>
#include <sys/resource.h>

#include <atomic>
#include <thread>

#include "redag/base/lock_guard.hpp"
#include "redag/base/mutex.hpp"
#include "redag/threads/clock.hpp"
#include "redag/threads/parker.hpp"

namespace redag::runtime {
namespace {

constexpr Duration kLongBody = 3600 * kSecond;
constexpr Duration kWhile = 20 * kMillisecond;  // in which nothing may happen

// One release at a time, which the test makes due.
class ReleaseThreadTest : public ::testing::Test {
 protected:
  Time expire() {
    if (monotonic_now() >= due) {
      due = kNever;
      by_leader = std::this_thread::get_id() == leader;
      released.set();
    }
    return due;
  }
  bool is_released_within(Duration time) { return released.wait_until(monotonic_now() + time); }

  const std::thread::id leader = std::this_thread::get_id();
  std::atomic<Time> due{kNever};
  std::atomic<bool> by_leader{false};
  Event released;
  ReleaseThread thread{[this] { return expire(); }};
};

TEST_F(ReleaseThreadTest, ReleasesWithoutALeader) {
  due = monotonic_now() + kMillisecond;
  ASSERT_TRUE(thread.start({}));
  EXPECT_TRUE(is_released_within(kLongBody));
  EXPECT_FALSE(by_leader);
}

// Before its start, while it waits, and after its end.
TEST_F(ReleaseThreadTest, HasThePriorityThatItIsGiven) {
  if (available_fifo_priority(3) < 3) GTEST_SKIP() << realtime_hint();
  std::atomic<int> seen{0};
  ReleaseThread raised([&] {
    seen = fifo_priority(pthread_self());
    released.set();
    return kNever;
  });
  EXPECT_TRUE(raised.set_priority(2));
  ASSERT_TRUE(raised.start({.name = "raised", .fifo_priority = 1, .cpus = {}}));
  released.wait();
  EXPECT_EQ(seen, 2);
  EXPECT_TRUE(raised.set_priority(3));
  raised.changed();
  const Time end = monotonic_now() + kLongBody;
  while (seen != 3 && monotonic_now() < end) std::this_thread::yield();
  EXPECT_EQ(seen, 3);
  raised.stop();
  raised.join();
  EXPECT_TRUE(raised.set_priority(1));
}

TEST_F(ReleaseThreadTest, LeavesTheReleaseToTheLeader) {
  ASSERT_TRUE(thread.start({}));
  due = monotonic_now() + kMillisecond;
  EXPECT_EQ(thread.lead(kNever), due);
  EXPECT_TRUE(thread.expects());
  EXPECT_FALSE(is_released_within(kWhile));
  EXPECT_EQ(thread.lead(kNever), kNever);
  EXPECT_TRUE(released.is_set());
  EXPECT_TRUE(by_leader);
  EXPECT_FALSE(thread.expects());
}

TEST_F(ReleaseThreadTest, ReleasesOnceTheLeaderHasAJob) {
  ASSERT_TRUE(thread.start({}));
  due = monotonic_now() + kMillisecond;
  EXPECT_EQ(thread.lead(kNever), due);
  thread.follow();
  EXPECT_TRUE(is_released_within(kLongBody));
  EXPECT_FALSE(by_leader);
}

TEST_F(ReleaseThreadTest, ReleasesOnceItsPatienceIsOver) {
  ASSERT_TRUE(thread.start({}));
  due = monotonic_now() + kMillisecond;
  EXPECT_EQ(thread.lead(kMillisecond), due);
  EXPECT_TRUE(is_released_within(kLongBody));
  EXPECT_FALSE(by_leader);
}

TEST_F(ReleaseThreadTest, ReleasesWhatComesBeforeTheLeadersTime) {
  ASSERT_TRUE(thread.start({}));
  due = monotonic_now() + kLongBody;
  EXPECT_EQ(thread.lead(kNever), due);
  due = monotonic_now() + kMillisecond;
  thread.changed();
  EXPECT_TRUE(is_released_within(kLongBody));
  EXPECT_FALSE(by_leader);
}

TEST_F(ReleaseThreadTest, ReleasesForALeaderThatExpectedNothing) {
  ASSERT_TRUE(thread.start({}));
  EXPECT_EQ(thread.lead(kNever), kNever);
  due = monotonic_now() + kMillisecond;
  thread.changed();
  EXPECT_TRUE(is_released_within(kLongBody));
}

TEST_F(ReleaseThreadTest, WhatIsDueAtTheStopIsReleasedAndNothingAfterIt) {
  ASSERT_TRUE(thread.start({}));
  due = monotonic_now() + kMillisecond;
  EXPECT_EQ(thread.lead(kNever), due);
  while (monotonic_now() < due) std::this_thread::yield();
  thread.stop();
  thread.join();
  EXPECT_TRUE(released.is_set());
  due = 0;
  EXPECT_EQ(thread.lead(kNever), kNever);
  EXPECT_EQ(thread.release_due(), kNever);
  EXPECT_EQ(due, 0);
}

TEST_F(ReleaseThreadTest, NeedsAFileDescriptor) {
  rlimit before{};
  ASSERT_EQ(getrlimit(RLIMIT_NOFILE, &before), 0);
  rlimit none = before;
  none.rlim_cur = 0;
  ASSERT_EQ(setrlimit(RLIMIT_NOFILE, &none), 0);
  const Result<void> refused = thread.start({});
  ASSERT_EQ(setrlimit(RLIMIT_NOFILE, &before), 0);
  ASSERT_FALSE(refused);
  EXPECT_NE(to_string(refused.error()).find("ulimit -n"), std::string::npos) << to_string(refused.error());
  EXPECT_TRUE(thread.start({})) << "it can be started again";
}

TEST(ReleaseThreadDeathTest, ReleasesNothingThatTakesAnUnboundedLock) {
  if constexpr (!kChecksLockClasses) GTEST_SKIP() << "only debug builds check this";
  Mutex ordinary;
  ReleaseThread thread([&] {
    const LockGuard guard(ordinary);
    return kNever;
  });
  EXPECT_DEATH(thread.release_due(), "a thread that must react");
}

}  // namespace
}  // namespace redag::runtime
