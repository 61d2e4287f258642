// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/experiment/unit_dispenser.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <numeric>
#include <set>
#include <vector>

namespace redag::experiment {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

class UnitDispenserTest : public ::testing::Test {
 protected:
  UnitDispenser make(std::uint64_t count, std::uint32_t ranks, std::uint32_t jobs = 1) {
    std::vector<std::uint64_t> units(count);
    std::iota(units.begin(), units.end(), std::uint64_t{0});
    return {units_of(std::move(units)), count, ranks, jobs, [this](std::uint64_t unit, const std::string &result) {
              EXPECT_EQ(result, std::to_string(unit));
              EXPECT_TRUE(accepted_.insert(unit).second) << "unit " << unit << " was accepted twice";
              return Result<void>{};
            }};
  }
  static void finish(UnitDispenser &dispenser, const std::vector<std::uint64_t> &units) {
    for (const std::uint64_t unit : units) ASSERT_TRUE(dispenser.finish(unit, std::to_string(unit)));
  }

  std::set<std::uint64_t> accepted_;
};

// Batches grow with the pace of the rank, up to the units of kBatchTime, and shrink towards the end.
TEST_F(UnitDispenserTest, BatchesFitThePace) {
  UnitDispenser dispenser = make(10'000, 2, 2);
  std::vector<std::size_t> sizes;
  Time now = 0;
  while (!dispenser.finished()) {
    const std::vector<std::uint64_t> units = dispenser.take(1, now);
    ASSERT_FALSE(units.empty());
    sizes.push_back(units.size());
    finish(dispenser, units);
    now += static_cast<Duration>(units.size()) * kMillisecond;  // a thousand units a second
  }
  EXPECT_EQ(accepted_.size(), 10'000U);
  EXPECT_THAT(std::vector(sizes.begin(), sizes.begin() + 6), ElementsAre(2, 16, 128, 1000, 1000, 1000));
  EXPECT_LE(sizes.back(), 2U) << "one for each job";
  EXPECT_EQ(dispenser.repeated(), 0U);
}

// Rank 2 is lost with its units: the others do them again, once nothing else is left.
TEST_F(UnitDispenserTest, UnitsOfALostRankAreDoneAgain) {
  UnitDispenser dispenser = make(6, 3);
  EXPECT_THAT(dispenser.take(2, 0), ElementsAre(0));
  EXPECT_THAT(dispenser.take(0, 0), ElementsAre(1));
  finish(dispenser, {1});
  Time now = 0;
  std::vector<std::uint64_t> seen;
  while (!dispenser.finished()) {
    const std::vector<std::uint64_t> units = dispenser.take(0, now += kSecond);
    ASSERT_EQ(units.size(), 1U);
    finish(dispenser, units);
    seen.push_back(units.front());
  }
  EXPECT_THAT(seen, ElementsAre(2, 3, 4, 5, 0));
  EXPECT_EQ(dispenser.repeated(), 1U);
  EXPECT_EQ(accepted_.size(), 6U);
  EXPECT_THAT(dispenser.take(0, now), IsEmpty());
}

TEST_F(UnitDispenserTest, TheFirstResultCounts) {
  UnitDispenser dispenser = make(1, 2);
  EXPECT_THAT(dispenser.take(0, 0), ElementsAre(0));
  EXPECT_THAT(dispenser.take(0, 0), IsEmpty()) << "its own units are no work for a rank";
  EXPECT_THAT(dispenser.take(1, 0), ElementsAre(0));
  EXPECT_THAT(dispenser.take(0, 0), ElementsAre(0)) << "both may be lost";
  finish(dispenser, {0});
  EXPECT_TRUE(dispenser.finished());
  finish(dispenser, {0, 7});
  EXPECT_EQ(dispenser.done(), 1U);
}

TEST_F(UnitDispenserTest, ErrorsOfAcceptAreReturned) {
  UnitDispenser dispenser(units_of({4}), 1, 1, 1,
                          [](std::uint64_t, const std::string &) -> Result<void> { return make_error("full"); });
  EXPECT_THAT(dispenser.take(0, 0), ElementsAre(4));
  EXPECT_FALSE(dispenser.finish(4, ""));
}

}  // namespace
}  // namespace redag::experiment
