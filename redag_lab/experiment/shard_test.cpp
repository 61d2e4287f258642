// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/experiment/shard.hpp"

#include <gtest/gtest.h>

namespace redag::experiment {
namespace {

TEST(Shard, EveryUnitHasOneOwner) {
  for (std::uint64_t unit = 0; unit < 100; ++unit) {
    int owners = 0;
    for (std::uint32_t i = 1; i <= 7; ++i) owners += Shard{i, 7}.owns(unit) ? 1 : 0;
    EXPECT_EQ(owners, 1) << unit;
  }
}

TEST(Shard, TextForm) {
  EXPECT_EQ(parse_shard("2/4"), (Shard{2, 4}));
  EXPECT_EQ(to_string(Shard{2, 4}), "2/4");
  for (const char *bad : {"", "2", "2/", "/4", "0/4", "5/4", "2/4x", "-1/4", "2/0", "a/b"}) {
    EXPECT_FALSE(parse_shard(bad)) << bad;
  }
}

}  // namespace
}  // namespace redag::experiment
