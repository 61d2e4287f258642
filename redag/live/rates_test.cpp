// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/live/rates.hpp"

#include <gtest/gtest.h>

namespace redag::live {
namespace {

TEST(Rates, AreOfTheWindow) {
  Frame frame;
  frame.window = 2 * kSecond;
  page::Figures figures{};
  figures.recent_jobs = 30;
  figures.recent_cpu = 100 * kMillisecond;
  EXPECT_EQ(rate_of(figures, frame), 15);
  EXPECT_DOUBLE_EQ(cpu_of(figures, frame), 0.05);
  const ThreadFrame thread{.used = kSecond, .recent_used = kSecond};
  EXPECT_DOUBLE_EQ(share_of(thread, frame), 0.5);
  const DeviceFrame device{
      .name = "gpu", .slots = 2, .served = 40, .recent_served = 8, .busy = 5 * kSecond, .recent_busy = kSecond};
  EXPECT_DOUBLE_EQ(share_of(device, frame), 0.25);
  EXPECT_EQ(rate_of(device, frame), 4);
  EXPECT_EQ(rate_of(figures, Frame{}), 0);
}

}  // namespace
}  // namespace redag::live
