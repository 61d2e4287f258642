// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/experiment/slurm.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace redag::experiment {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

// tests/cli/slurm.py runs such scripts on a real Slurm.
TEST(Slurm, ScriptsOfAnArrayAndItsMerge) {
  const std::vector<SlurmScript> scripts = slurm_scripts({.program = "/opt/it's/redag",
                                                          .experiment = "factorial",
                                                          .name = "of\n#SBATCH --uid=0",
                                                          .shards = 12,
                                                          .cpus = 4,
                                                          .time = 90 * kSecond});
  ASSERT_EQ(scripts.size(), 3U);
  EXPECT_EQ(scripts[0].name, kSubmitScript);
  EXPECT_THAT(scripts[0].text, HasSubstr("--dependency=\"afterany:${array%%;*}\" \"$@\" merge.sbatch"));
  EXPECT_EQ(scripts[1].name, "shard.sbatch");
  EXPECT_THAT(scripts[1].text, HasSubstr("#SBATCH --array=1-12\n"));
  EXPECT_THAT(scripts[1].text, HasSubstr("#SBATCH --cpus-per-task=4\n#SBATCH --time=2\n"));
  EXPECT_THAT(scripts[1].text, HasSubstr("exec '/opt/it'\\''s/redag' experiment factorial plan.yaml --shard "
                                         "\"$SLURM_ARRAY_TASK_ID/12\" -j4 --out 'shards/{shard}'\n"));
  EXPECT_THAT(scripts[1].text, Not(HasSubstr("\n#SBATCH --uid"))) << "a plan's name is no option";
  EXPECT_EQ(scripts[2].name, "merge.sbatch");
  EXPECT_THAT(scripts[2].text, HasSubstr("experiment merge shards/* --out merged.new\n"));
}

}  // namespace
}  // namespace redag::experiment
