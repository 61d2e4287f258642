// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/base/alarm.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include <ctime>
#include <thread>

namespace redag {
namespace {

Time now() {
  timespec time{};
  clock_gettime(CLOCK_MONOTONIC, &time);
  return static_cast<Time>(time.tv_sec) * kSecond + time.tv_nsec;
}

constexpr Duration kLong = 3600 * kSecond;

class AlarmTest : public ::testing::Test {
 protected:
  void SetUp() override { ASSERT_TRUE(alarm_.open()); }
  Alarm alarm_;
};

TEST_F(AlarmTest, GoesOffAtItsTimeAndNotBefore) {
  const Time at = now() + 2 * kMillisecond;
  alarm_.set(at);
  alarm_.wait();
  EXPECT_GE(now(), at);
}

// Helpers that make a daemon close all descriptors. Each wait then takes a millisecond.
TEST_F(AlarmTest, WithoutItsDescriptorItDoesNotSpin) {
  const int next = ::dup(0);
  ASSERT_GE(next, 0);
  ::close(next);
  Alarm alarm;
  ASSERT_TRUE(alarm.open());  // has the descriptor that was free
  ::close(next);
  int waits = 0;
  for (const Time end = now() + 20 * kMillisecond; now() < end; ++waits) alarm.wait();
  EXPECT_LE(waits, 20);
}

TEST_F(AlarmTest, ATimeThatHasPassedGoesOffAtOnce) {
  for (const Time at : {now() - kSecond, Time{0}, -kSecond}) {
    alarm_.set(at);
    alarm_.wait();
  }
}

TEST_F(AlarmTest, OthersMoveTheTimeWhileItsOwnerSleeps) {
  alarm_.set(now() + kLong);
  std::thread other([&] { alarm_.set(now() + kMillisecond); });
  alarm_.wait();
  other.join();
}

TEST_F(AlarmTest, ATimeThatWasRemovedDoesNotGoOff) {
  const Time at = now() + 20 * kMillisecond;
  alarm_.set(now() + kMillisecond);
  alarm_.set(kNever);
  alarm_.set(at);
  alarm_.wait();
  EXPECT_GE(now(), at);
}

TEST_F(AlarmTest, ARingIsNotLostIfATimeFollows) {
  alarm_.ring();
  alarm_.set(now() + kLong);
  alarm_.set(kNever);
  alarm_.wait();
}

TEST_F(AlarmTest, ARingWakesItsOwner) {
  std::thread other([&] { alarm_.ring(); });
  alarm_.wait();
  other.join();
  // One ring, one return: the next time holds again.
  const Time at = now() + 2 * kMillisecond;
  alarm_.set(at);
  alarm_.wait();
  EXPECT_GE(now(), at);
}

}  // namespace
}  // namespace redag
