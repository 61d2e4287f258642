// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/experiment/slurm.hpp"

#include <algorithm>
#include <cctype>

#include <fmt/format.h>

namespace redag::experiment {
namespace {

constexpr Duration kMinute = 60 * kSecond;

// Quotes a word for sh.
std::string quoted(const std::string &word) {
  std::string text = "'";
  for (const char c : word) text += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return text + "'";
}

// Names of jobs go into comments that Slurm reads; plans are free in theirs.
std::string job_name(const std::string &name) {
  std::string text = "redag-" + name.substr(0, 40);
  std::replace_if(
      text.begin(), text.end(), [](unsigned char c) { return std::isalnum(c) == 0 && c != '-'; }, '_');
  return text;
}

}  // namespace

std::vector<SlurmScript> slurm_scripts(const SlurmJob &job) {
  const std::string program = quoted(job.program);
  const std::string name = job_name(job.name);
  const Duration minutes = std::max<Duration>(1, (job.time + kMinute - 1) / kMinute);
  return {{kSubmitScript, R"sh(#!/bin/sh
# Submits the shards, and the merge after them. Arguments are options of sbatch, such as --partition=long.
# Run it again after a failure or a time limit: every shard goes on from what it has finished.
set -eu
cd "$(dirname "$0")"
mkdir -p logs shards
array=$(sbatch --parsable "$@" shard.sbatch)
merge=$(sbatch --parsable --dependency="afterany:${array%%;*}" "$@" merge.sbatch)
echo "array job ${array%%;*}, merge job ${merge%%;*}"
)sh"},
          {"shard.sbatch", fmt::format(R"sh(#!/bin/sh
#SBATCH --job-name={0}
#SBATCH --array=1-{1}
#SBATCH --ntasks=1
#SBATCH --cpus-per-task={2}
#SBATCH --time={3}
#SBATCH --signal=B:TERM@30
#SBATCH --requeue
#SBATCH --open-mode=append
#SBATCH --output=logs/shard-%a.log
# exec: the signal before the time limit reaches redag, which then writes the results so far.
exec {4} experiment {5} plan.yaml --shard "$SLURM_ARRAY_TASK_ID/{1}" -j{2} --out 'shards/{{shard}}'
)sh",
                                       name, job.shards, job.cpus, minutes, program, job.experiment)},
          {"merge.sbatch", fmt::format(R"sh(#!/bin/sh
#SBATCH --job-name={0}-merge
#SBATCH --ntasks=1
#SBATCH --open-mode=append
#SBATCH --output=logs/merge.log
rm -rf merged.new
{1} experiment merge shards/* --out merged.new
status=$?
[ "$status" -le 1 ] || exit "$status"
rm -rf merged && mv merged.new merged
exit "$status"
)sh",
                                       name, program)}};
}

}  // namespace redag::experiment
