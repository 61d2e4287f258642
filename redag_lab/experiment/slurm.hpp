// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The scripts of an experiment on a Slurm cluster: an array job with a task for each shard, and a job that merges their
// folders. Pure functions.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "redag/base/time.hpp"

namespace redag::experiment {

struct SlurmJob {
  std::string program;     // path of redag, the same on all nodes
  std::string experiment;  // "acceptance" or "factorial"
  std::string name;        // of the plan
  std::uint32_t shards = 1;
  std::uint32_t cpus = 1;  // of a task
  Duration time = 0;       // limit of a task; a shard that needs more goes on when it is submitted again
};

struct SlurmScript {
  std::string name;
  std::string text;
};

/// The first of slurm_scripts(): sh runs it, and its arguments are options of sbatch.
inline constexpr const char *kSubmitScript = "submit.sh";

/// Returns the scripts for a folder that holds plan.yaml. The shards' results go to shards/<i>, those of all to merged.
[[nodiscard]] std::vector<SlurmScript> slurm_scripts(const SlurmJob &job);

}  // namespace redag::experiment
