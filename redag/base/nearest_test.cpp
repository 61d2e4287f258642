// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/base/nearest.hpp"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

namespace redag {
namespace {

TEST(EditDistance, CountsEdits) {
  EXPECT_EQ(edit_distance("kitten", "sitting", 10), 3U);
  EXPECT_EQ(edit_distance("", "abc", 10), 3U);
  EXPECT_EQ(edit_distance("wect", "wcet", 10), 2U);
  EXPECT_EQ(edit_distance("kitten", "sitting", 2), 3U);  // gives up
}

RC_GTEST_PROP(EditDistance, IsAMetric, (const std::string &a, const std::string &b, const std::string &c)) {
  constexpr std::size_t kNoLimit = 1'000'000;
  RC_ASSERT((edit_distance(a, b, kNoLimit) == 0) == (a == b));
  RC_ASSERT(edit_distance(a, b, kNoLimit) == edit_distance(b, a, kNoLimit));
  RC_ASSERT(edit_distance(a, c, kNoLimit) <= edit_distance(a, b, kNoLimit) + edit_distance(b, c, kNoLimit));
}

TEST(Nearest, IsOnlyOfferedWhenItIsNear) {
  EXPECT_EQ(nearest("wect", {"name", "wcet", "bcet"}), "wcet");
  EXPECT_EQ(nearest("lidra", {"camera", "lidar"}), "lidar");
  EXPECT_EQ(nearest("x", {"y"}), "");
  EXPECT_EQ(nearest("colour", {"name", "wcet", "group"}), "");
  EXPECT_EQ(nearest("a1", {}), "");
  EXPECT_EQ(nearest("tcsh", {"bash", "zsh", "fish"}), "") << "each is two edits away";
  EXPECT_EQ(nearest("bsh", {"zsh", "bash", "fish"}), "zsh");
}

}  // namespace
}  // namespace redag
