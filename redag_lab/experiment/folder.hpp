// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The folder of an experiment: plan.yaml (the plan), units.csv (the finished units; journal.hpp) and runs.jsonl (the
// runs: version, machine, time). Its other files are derived from these. Not thread-safe.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "redag/base/result.hpp"
#include "redag/base/time.hpp"
#include "redag_lab/experiment/journal.hpp"
#include "redag_lab/experiment/shard.hpp"

namespace redag::experiment {

/// Opens the units of `folder`, which must exist, for `plan` (canonical text). Errors: those of Journal::open(), and a
/// folder that holds another plan, with the first line that differs.
[[nodiscard]] Result<Journal> open_folder(const std::string &folder, const std::string &plan);

/// Reads the plan of a folder with results.
[[nodiscard]] Result<std::string> read_plan(const std::string &folder);

/// Reads the finished units of several folders, which must hold the same plan, in order of unit. Errors: as
/// open_folder().
[[nodiscard]] Result<std::vector<FinishedUnit>> read_folders(const std::vector<std::string> &folders,
                                                             const std::string &plan);

/// A run has two lines in runs.jsonl: one at its begin and one at its end. A killed run has only the first.
struct RunBegin {
  Shard shard;
  std::uint32_t jobs = 1;
  std::uint64_t units = 0;  // to do
};
struct RunEnd {
  std::uint64_t units = 0;  // done
  Duration elapsed = 0;
  bool interrupted = false;
};
/// Appends a line, with this machine, the version of redag and the time of day.
[[nodiscard]] Result<void> log_run(const std::string &folder, const RunBegin &run);
[[nodiscard]] Result<void> log_run(const std::string &folder, const RunEnd &run);
/// Returns the lines of all folders in turn; a folder without the file has none.
[[nodiscard]] std::vector<std::string> read_runs(const std::vector<std::string> &folders);
/// Appends lines of other folders.
[[nodiscard]] Result<void> add_runs(const std::string &folder, const std::vector<std::string> &lines);

}  // namespace redag::experiment
