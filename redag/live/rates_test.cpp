// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/live/rates.hpp"

#include <gtest/gtest.h>

namespace redag::live {
namespace {

TEST(Rates, AreOfTheWindowOrOfAll) {
  Frame frame;
  frame.began = 10 * kSecond;
  frame.published = 20 * kSecond;
  frame.window = 2 * kSecond;
  page::Figures figures{};
  figures.finished = 100;
  figures.recent_jobs = 30;
  figures.cpu = kSecond;
  figures.recent_cpu = 100 * kMillisecond;
  EXPECT_EQ(rate_of(figures, frame, false), 15);
  EXPECT_EQ(rate_of(figures, frame, true), 10);
  EXPECT_DOUBLE_EQ(cpu_of(figures, frame, false), 0.05);
  EXPECT_DOUBLE_EQ(cpu_of(figures, frame, true), 0.1);
  const ThreadFrame thread{.used = kSecond, .recent_used = kSecond};
  EXPECT_DOUBLE_EQ(share_of(thread, frame, false), 0.5);
  EXPECT_DOUBLE_EQ(share_of(thread, frame, true), 0.1);
  const DeviceFrame device{
      .name = "gpu", .slots = 2, .served = 40, .recent_served = 8, .busy = 5 * kSecond, .recent_busy = kSecond};
  EXPECT_DOUBLE_EQ(share_of(device, frame, false), 0.25);
  EXPECT_DOUBLE_EQ(share_of(device, frame, true), 0.25);
  EXPECT_EQ(rate_of(device, frame, false), 4);
  EXPECT_EQ(rate_of(device, frame, true), 4);
  EXPECT_EQ(rate_of(figures, Frame{}, false), 0);
}

}  // namespace
}  // namespace redag::live
