// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/experiment/shard.hpp"

#include <gtest/gtest.h>

#include <map>
#include <string>

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

// Returns what a process with these variables takes for its share; empty if it cannot tell.
std::string share_of(const std::map<std::string, std::string> &variables) {
  const Result<Shard> shard = shard_of_environment([&variables](const char *name) -> const char * {
    const auto found = variables.find(name);
    return found == variables.end() ? nullptr : found->second.c_str();
  });
  return shard ? to_string(*shard) : "";
}

TEST(Shard, OfTheEnvironment) {
  using Variables = std::map<std::string, std::string>;
  const Variables array = {{"SLURM_ARRAY_TASK_ID", "7"},
                           {"SLURM_ARRAY_TASK_COUNT", "4"},
                           {"SLURM_ARRAY_TASK_MIN", "3"},
                           {"SLURM_ARRAY_TASK_MAX", "9"},
                           {"SLURM_ARRAY_TASK_STEP", "2"}};
  EXPECT_EQ(share_of(array), "3/4");
  EXPECT_EQ(share_of({{"SLURM_PROCID", "0"}, {"SLURM_STEP_NUM_TASKS", "8"}}), "1/8");
  EXPECT_EQ(share_of({{"OMPI_COMM_WORLD_RANK", "3"}, {"OMPI_COMM_WORLD_SIZE", "4"}}), "4/4");
  EXPECT_EQ(share_of({{"PMI_RANK", "1"}, {"PMI_SIZE", "2"}}), "2/2");
  Variables both = array;
  both.insert({{"SLURM_PROCID", "1"}, {"SLURM_STEP_NUM_TASKS", "2"}});
  EXPECT_EQ(share_of(both), "6/8");

  EXPECT_EQ(share_of({}), "");
  EXPECT_EQ(share_of({{"OMPI_COMM_WORLD_RANK", "4"}, {"OMPI_COMM_WORLD_SIZE", "4"}}), "");
  EXPECT_EQ(share_of({{"PMI_RANK", "one"}, {"PMI_SIZE", "2"}}), "");
  // A batch script runs once, however many tasks its job has.
  EXPECT_EQ(share_of({{"SLURM_PROCID", "0"}, {"SLURM_NTASKS", "8"}}), "");
  Variables gaps = array;
  gaps["SLURM_ARRAY_TASK_COUNT"] = "3";
  EXPECT_EQ(share_of(gaps), "");
}

}  // namespace
}  // namespace redag::experiment
