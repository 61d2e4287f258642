// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/experiment/proportion.hpp"

#include <gtest/gtest.h>

namespace redag::experiment {
namespace {

// Published values for 81 of 263, 15 of 148, 0 of 20 and 1 of 29: R. Newcombe, Statistics in Medicine 17(8), 1998,
// table I, method 3.
TEST(Proportion, PublishedIntervals) {
  const Proportion a = proportion(81, 263);
  EXPECT_NEAR(a.low, 0.2553, 5e-5);
  EXPECT_NEAR(a.high, 0.3662, 5e-5);
  const Proportion b = proportion(15, 148);
  EXPECT_NEAR(b.low, 0.0624, 5e-5);
  EXPECT_NEAR(b.high, 0.1605, 5e-5);
  const Proportion c = proportion(0, 20);
  EXPECT_EQ(c.low, 0);
  EXPECT_NEAR(c.high, 0.1611, 5e-5);
  const Proportion d = proportion(1, 29);
  EXPECT_NEAR(d.low, 0.0061, 5e-5);
  EXPECT_NEAR(d.high, 0.1718, 5e-5);
}

TEST(Proportion, Ends) {
  EXPECT_EQ(proportion(0, 0).low, 0);
  EXPECT_EQ(proportion(0, 0).high, 1);
  EXPECT_EQ(proportion(50, 50).high, 1);
  EXPECT_LT(proportion(50, 50).low, 1);
}

}  // namespace
}  // namespace redag::experiment
