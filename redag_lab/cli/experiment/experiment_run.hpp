// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Shared by all experiments: running units with progress and Ctrl-C, continuing after a kill, shards, merging, and
// showing results.
#pragma once

#include <CLI/CLI.hpp>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "redag_lab/cli/experiment/experiment_study.hpp"
#include "redag_lab/cli/terminal/console.hpp"
#include "redag_lab/experiment/shard.hpp"
#include "redag_lab/experiment/unit_store.hpp"

namespace redag::cli {

struct StudyOutput {
  std::string folder;
  bool force = false;
  bool json = false;
};
/// Adds the options. Returns the option of the folder.
CLI::Option *add_study_output(CLI::App &app, StudyOutput &output, const std::string &names, const std::string &help);

struct StudySettings {
  std::uint32_t jobs = 0;  // 0: one per processor
  experiment::Shard shard;
  bool mpi = false;
  StudyOutput output;
};
/// Adds the options of a command that runs a study.
void add_study_settings(CLI::App &app, StudySettings &settings);

/// Runs the unfinished units and shows the results. Returns the exit status; ends the process after an MPI run.
[[nodiscard]] int run_study(Study &study, StudySettings settings, Console &console);

/// Makes the study of a plan's text. Returns null after printing the mistakes, which name the plan as `file`.
using StudyMaker =
    std::function<std::unique_ptr<Study>(const std::string &plan, const std::string &file, Console &console)>;

/// Finished units for a new folder.
struct MergedUnits {
  std::string plan;
  std::string plan_file;                                                // its name in messages
  std::function<Result<void>(const experiment::Accept &accept)> visit;  // goes over all units, in order
  std::vector<std::string> runs;                                        // lines of runs.jsonl
};
/// Reads folders that hold one plan. Visits read their units each time, one at a time.
[[nodiscard]] Result<MergedUnits> read_merged(const std::vector<std::string> &folders);

/// Writes the units into the folder of `output`. Returns the exit status.
[[nodiscard]] int merge_studies(const MergedUnits &merged, const StudyOutput &output, const StudyMaker &make,
                                Console &console);

}  // namespace redag::cli
