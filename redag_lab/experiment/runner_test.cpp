// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/experiment/unit_store.hpp"

#include <gtest/gtest.h>

#include <numeric>
#include <set>
#include <thread>
#include <vector>

namespace redag::experiment {
namespace {

std::vector<std::uint64_t> first(std::uint64_t count) {
  std::vector<std::uint64_t> units(count);
  std::iota(units.begin(), units.end(), std::uint64_t{0});
  return units;
}

// Early units take longest, and later ones finish before them.
Result<std::string> slow_at_first(std::uint64_t unit) {
  if (unit < 4) std::this_thread::sleep_for(std::chrono::milliseconds(20));
  return std::to_string(unit * unit);
}

const std::atomic<bool> kNever{false};

TEST(Runner, HandsOverEveryUnitOnceForAnyNumberOfJobs) {
  for (const std::uint32_t jobs : {1U, 2U, 5U}) {
    std::set<std::uint64_t> seen;
    const auto done = run_units(first(300), jobs, kNever, slow_at_first,
                                [&](std::uint64_t unit, const std::string &result) -> Result<void> {
                                  EXPECT_EQ(result, std::to_string(unit * unit));
                                  EXPECT_TRUE(seen.insert(unit).second);
                                  return {};
                                });
    EXPECT_TRUE(done);
    EXPECT_EQ(seen.size(), 300U) << jobs;
  }
}

TEST(Runner, EvaluatesOnSeveralThreads) {
  std::atomic<int> inside{0};
  std::atomic<bool> met{false};
  const auto meet = [&](std::uint64_t) -> Result<std::string> {
    ++inside;
    // Waits until another unit has begun. A runner with one thread never gets there, and the test fails.
    for (int i = 0; i < 5000 && inside < 2; ++i) std::this_thread::sleep_for(std::chrono::milliseconds(1));
    if (inside >= 2) met = true;
    return "";
  };
  EXPECT_TRUE(run_units(first(2), 2, kNever, meet, [](auto, const auto &) { return Result<void>{}; }));
  EXPECT_TRUE(met);
}

TEST(Runner, StopLeavesOutWhatHasNotBegun) {
  std::atomic<bool> stop{false};
  std::uint64_t accepted = 0;
  const auto done = run_units(first(100'000), 2, stop, slow_at_first, [&](std::uint64_t, const std::string &) {
    if (++accepted == 10) stop = true;
    return Result<void>{};
  });
  EXPECT_TRUE(done);
  EXPECT_GE(accepted, 10U);
  EXPECT_LE(accepted, 11U);
}

TEST(Runner, AnErrorEndsIt) {
  std::uint64_t accepted = 0;
  const auto done = run_units(
      first(1000), 3, kNever,
      [](std::uint64_t unit) -> Result<std::string> {
        if (unit == 50) return make_error("unit 50");
        return "";
      },
      [&](std::uint64_t, const std::string &) {
        ++accepted;
        return Result<void>{};
      });
  ASSERT_FALSE(done);
  EXPECT_EQ(done.error().front().message, "unit 50");
  EXPECT_LT(accepted, 1000U);
}

TEST(Runner, WhatCannotBeKeptEndsIt) {
  const auto done = run_units(first(1000), 2, kNever, slow_at_first,
                              [](std::uint64_t, const std::string &) -> Result<void> { return make_error("full"); });
  ASSERT_FALSE(done);
  EXPECT_EQ(done.error().size(), 1U);
}

}  // namespace
}  // namespace redag::experiment
