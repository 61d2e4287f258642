// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The folder of an experiment: plan.yaml (the plan), units.db (the finished units; unit_store.hpp) and runs.jsonl (the
// runs: version, machine, time). Its other files are derived from these. Not thread-safe.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "redag/base/result.hpp"
#include "redag/base/time.hpp"
#include "redag_lab/experiment/shard.hpp"
#include "redag_lab/experiment/unit_store.hpp"

namespace redag::experiment {

/// Error: the folder holds another plan (canonical text), with the first line that differs.
[[nodiscard]] Result<void> expect_plan_of(const std::string &folder, const std::string &plan);

/// Opens the units of `folder`, which must exist, for `plan` (canonical text). Errors: those of UnitStore::open(), and
/// a folder that holds another plan, with the first line that differs.
[[nodiscard]] Result<UnitStore> open_folder(const std::string &folder, const std::string &plan);

/// Reads the plan of a folder with results.
[[nodiscard]] Result<std::string> read_plan(const std::string &folder);

/// Visits the finished units of several folders, which must hold the same plan, once each and in order of unit. Keeps
/// one unit of each folder in memory. Errors: as open_folder(), those of `accept`, and a unit with two results.
[[nodiscard]] Result<void> visit_units(const std::vector<std::string> &folders, const std::string &plan,
                                       const Accept &accept);

/// A run has two lines in runs.jsonl: one at its begin and one at its end. A killed run has only the first.
struct RunBegin {
  Shard shard;
  std::uint32_t jobs = 1;   // of each rank
  std::uint32_t ranks = 1;  // of an MPI run
  std::uint64_t units = 0;  // to do
};
struct RunEnd {
  std::uint64_t units = 0;  // done
  Duration elapsed = 0;
  bool interrupted = false;
};
/// Appends a line, with this machine, the job of Slurm, the version of redag and the time of day.
[[nodiscard]] Result<void> log_run(const std::string &folder, const RunBegin &run);
[[nodiscard]] Result<void> log_run(const std::string &folder, const RunEnd &run);
/// Returns the lines of all folders in turn; a folder without the file has none.
[[nodiscard]] std::vector<std::string> read_runs(const std::vector<std::string> &folders);
/// Appends lines of other folders.
[[nodiscard]] Result<void> add_runs(const std::string &folder, const std::vector<std::string> &lines);

}  // namespace redag::experiment
