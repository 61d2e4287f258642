// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/experiment/observation_log.hpp"

#include <gtest/gtest.h>

#include <map>

namespace redag::experiment {
namespace {

Observation of_seed(std::uint64_t seed) {
  Observation seen;
  seen.seed = seed;
  seen.world = "simulator";
  seen.dags.push_back({"total", {}, {}});
  return seen;
}

// Whatever stays in memory, a group is what was added to it.
TEST(ObservationLog, GivesEachGroupBack) {
  for (const std::size_t kept : {0U, 7U, 1000U}) {
    ObservationLog log(kept);
    std::map<std::size_t, std::vector<ObservationLog::Place>> places;
    for (std::uint64_t seed = 0; seed < 60; ++seed) {
      const auto place = log.add(to_line(of_seed(seed)));
      ASSERT_TRUE(place);
      places[seed % 12].push_back(*place);
    }
    for (const std::size_t group : {0U, 1U, 0U, 5U, 11U, 3U, 4U, 6U, 7U, 0U, 12U, 1U}) {
      const std::vector<Observation> &first = log.read(group, places[group]);
      for (const std::size_t other : {2U, 8U, 9U, 10U}) static_cast<void>(log.read(other, places[other]));
      ASSERT_EQ(first.size(), group < 12 ? 5U : 0U) << "valid after four others";
      for (std::size_t i = 0; i < first.size(); ++i) EXPECT_EQ(first[i], of_seed(group + 12 * i));
    }
  }
}

TEST(ObservationLog, ForgetsAGroupThatChanges) {
  ObservationLog log;
  std::vector<ObservationLog::Place> places = {*log.add(to_line(of_seed(1)))};
  EXPECT_EQ(log.read(3, places).size(), 1U);
  places.push_back(*log.add(to_line(of_seed(2))));
  log.forget(3);
  log.forget(4);
  ASSERT_EQ(log.read(3, places).size(), 2U);
  EXPECT_EQ(log.read(3, places)[1], of_seed(2));
}

}  // namespace
}  // namespace redag::experiment
