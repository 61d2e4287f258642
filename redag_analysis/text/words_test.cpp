// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/text/words.hpp"

#include <gtest/gtest.h>

namespace redag {
namespace {

TEST(Words, OneIsNotPlural) {
  EXPECT_EQ(plural(0, "job"), "0 jobs");
  EXPECT_EQ(plural(1, "job"), "1 job");
  EXPECT_EQ(plural(2000, "job"), "2 000 jobs");
  EXPECT_EQ(plural(1, "entry", "entries"), "1 entry");
  EXPECT_EQ(plural(2, "entry", "entries"), "2 entries");
}

TEST(Words, ListsReadAsSentences) {
  EXPECT_EQ(join({}), "");
  EXPECT_EQ(join({"a"}), "a");
  EXPECT_EQ(join({"a", "b"}), "a and b");
  EXPECT_EQ(join({"a", "b", "c"}), "a, b and c");
  EXPECT_EQ(join_first({"a", "b", "c"}, 3), "a, b and c");
  EXPECT_EQ(join_first({"a", "b", "c"}, 2), "a, b and 1 other");
  EXPECT_EQ(join_first({"a", "b", "c", "d"}, 2), "a, b and 2 others");
}

}  // namespace
}  // namespace redag
