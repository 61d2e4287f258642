// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/sim/release_tree.hpp"

#include <algorithm>
#include <vector>

#include <gtest/gtest.h>

#include "redag/derived/rng.hpp"

namespace redag::sim {
namespace {

TEST(ReleaseTree, FindsTheFirstReleaseAndItsFirstTask) {
  for (std::size_t count = 0; count <= 33; ++count) {
    ReleaseTree tree(count);
    EXPECT_EQ(tree.next(), kNever);
    std::vector<Time> seen(count, kNever);
    Rng rng(mix(count));
    for (int i = 0; i < 300 && count > 0; ++i) {
      const auto task = static_cast<std::size_t>(rng.uniform(0, static_cast<std::int64_t>(count) - 1));
      seen[task] = rng.uniform(0, 4) == 0 ? kNever : rng.uniform(0, 20);
      tree.set(TaskId(task), seen[task]);
      const auto first = std::min_element(seen.begin(), seen.end());
      ASSERT_EQ(tree.next(), *first);
      if (*first == kNever) continue;
      ASSERT_EQ(tree.task().value, static_cast<std::uint32_t>(first - seen.begin()));
    }
  }
}

}  // namespace
}  // namespace redag::sim
