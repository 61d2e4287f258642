// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "tests/testing/exploration/exploration_states.hpp"

#include <gtest/gtest.h>

#include <array>

namespace redag::analysis {
namespace {

using Row = std::vector<Interval>;
constexpr std::array<std::uint32_t, 2> kCounts{1, 2};
constexpr std::uint64_t kHash = 7;

std::vector<Row> states_of(const StateSet &states, std::uint32_t node) {
  std::vector<Row> rows;
  states.for_each(node, [&](std::span<const Interval> row) { rows.emplace_back(row.begin(), row.end()); });
  return rows;
}

TEST(StateSet, StatesThatTouchBecomeOne) {
  StateSet states(2, 1, 1);
  const std::uint32_t node = states.find_or_add(kCounts, kHash);
  EXPECT_TRUE(states.add(node, Row{{1, 2}}));
  EXPECT_TRUE(states.add(node, Row{{6, 7}}));
  EXPECT_TRUE(states.add(node, Row{{4, 4}})) << "3 and 5 are between";
  EXPECT_EQ(states_of(states, node).size(), 3U);
  EXPECT_FALSE(states.add(node, Row{{3, 3}}));
  EXPECT_EQ(states_of(states, node), (std::vector<Row>{{{1, 4}}, {{6, 7}}}));
  EXPECT_FALSE(states.add(node, Row{{5, 5}})) << "joins what it touches on both sides";
  EXPECT_EQ(states_of(states, node), (std::vector<Row>{{{1, 7}}}));
  EXPECT_FALSE(states.add(node, Row{{2, 6}}));
}

// Only the workers' intervals must touch; the others are united with them.
TEST(StateSet, OneWorkerApartKeepsStatesApart) {
  StateSet states(2, 3, 2);
  const std::uint32_t node = states.find_or_add(kCounts, kHash);
  EXPECT_TRUE(states.add(node, Row{{1, 2}, {5, 5}, {0, 0}}));
  EXPECT_TRUE(states.add(node, Row{{1, 2}, {7, 9}, {0, 0}}));
  EXPECT_FALSE(states.add(node, Row{{2, 3}, {4, 5}, {8, 8}}));
  EXPECT_EQ(states_of(states, node), (std::vector<Row>{{{1, 3}, {4, 5}, {0, 8}}, {{1, 2}, {7, 9}, {0, 0}}}));
}

// A state that lies only in the union of two followed states was not followed.
TEST(StateSet, OnlyWhatWasKeptIsCovered) {
  StateSet seen(2, 2, 2);
  const std::uint32_t node = seen.find_or_add(kCounts, kHash);
  seen.keep(node, Row{{1, 2}, {3, 4}});
  seen.keep(node, Row{{2, 3}, {4, 5}});
  EXPECT_TRUE(seen.covers(kCounts, kHash, Row{{1, 1}, {3, 4}}));
  EXPECT_TRUE(seen.covers(kCounts, kHash, Row{{3, 3}, {4, 5}}));
  EXPECT_FALSE(seen.covers(kCounts, kHash, Row{{1, 3}, {4, 4}}));
  EXPECT_FALSE(seen.covers(kCounts, kHash, Row{{1, 1}, {5, 5}}));
  EXPECT_FALSE(seen.covers(std::array<std::uint32_t, 2>{2, 1}, kHash, Row{{1, 1}, {3, 4}})) << "another node";
}

TEST(StateSet, NodesAreFoundAgain) {
  StateSet states(2, 1, 1);
  for (std::uint32_t i = 0; i < 1000; ++i) {
    // There are few hashes, and equal ones must not lead to equal nodes.
    EXPECT_EQ(states.find_or_add(std::array<std::uint32_t, 2>{i, i + 1}, i % 10), i);
  }
  for (std::uint32_t i = 0; i < 1000; ++i) {
    EXPECT_EQ(states.find_or_add(std::array<std::uint32_t, 2>{i, i + 1}, i % 10), i);
    EXPECT_EQ(states.counts(i)[1], i + 1);
  }
  states.add(5, Row{{1, 2}});
  EXPECT_TRUE(states.has_states());
  states.remove_if([](std::uint32_t node, std::span<const Interval> row) { return node == 5 && row[0].latest == 2; });
  EXPECT_FALSE(states.has_states());
  states.clear();
  EXPECT_EQ(states.size(), 0U);
  EXPECT_EQ(states.find_or_add(kCounts, kHash), 0U);
}

}  // namespace
}  // namespace redag::analysis
