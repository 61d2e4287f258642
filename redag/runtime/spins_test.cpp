// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/runtime/spins.hpp"

#include <gtest/gtest.h>

namespace redag::runtime {
namespace {

TEST(Looks, AreProportionalToTheDuration) {
  EXPECT_EQ(spins_in(0), 0U);
  EXPECT_EQ(spins_in(1), 1U);
  const std::uint32_t in_a_millisecond = spins_in(kMillisecond);
  EXPECT_GT(in_a_millisecond, 100U);  // a spin takes less than 10 us
  EXPECT_NEAR(spins_in(10 * kMillisecond), 10.0 * in_a_millisecond, 10);
  EXPECT_EQ(spins_in(1'000'000 * kSecond), 0xffffffffU);
}

}  // namespace
}  // namespace redag::runtime
