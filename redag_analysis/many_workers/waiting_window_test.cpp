// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/many_workers/waiting_window.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

#include "redag/derived/rng.hpp"

namespace redag::analysis::global {
namespace {

// Searches instant by instant for the least d with sum_i min(least_i, d) + rest < m d.
Duration first_window(const std::vector<Duration> &least, Duration rest, std::uint32_t workers) {
  for (Duration d = 1;; ++d) {
    Duration sum = rest;
    for (const Duration each : least) sum += std::min(each, d);
    if (sum < static_cast<Duration>(workers) * d) return d;
  }
}

TEST(WaitingWindow, BeginsWhereNoShorterOneDoes) {
  for (std::uint64_t seed = 0; seed < 2000; ++seed) {
    SCOPED_TRACE(seed);
    Rng rng(seed);
    const auto workers = static_cast<std::uint32_t>(rng.uniform(1, 6));
    const Duration rest = rng.uniform(0, 1) == 0 ? 0 : rng.uniform(0, 40);
    std::vector<Duration> least(static_cast<std::size_t>(rng.uniform(0, 9)));
    FirstWindow window(workers, rest);
    for (Duration &each : least) window.add(each = rng.uniform(1, 20));
    EXPECT_EQ(window.length(), first_window(least, rest, workers));
  }
}

}  // namespace
}  // namespace redag::analysis::global
