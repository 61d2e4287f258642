// What the experiments share: running units with progress and Ctrl-C, going on after a kill, shards, merging, showing.
#pragma once

#include <CLI/CLI.hpp>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "redag/cli/console.hpp"
#include "redag/cli/experiment_study.hpp"
#include "redag/experiment/shard.hpp"

namespace redag::cli {

struct StudyOutput {
  std::string folder;
  bool force = false;
  bool json = false;
};
void add_study_output(CLI::App &app, StudyOutput &output, const std::string &names, const std::string &help);

struct StudySettings {
  std::uint32_t jobs = 0;  // 0: one a processor
  experiment::Shard shard;
  StudyOutput output;
};
/// Options of a command that runs a study.
void add_study_settings(CLI::App &app, StudySettings &settings);

/// Runs what is not finished, and shows the results. Returns the exit status.
[[nodiscard]] int run_study(Study &study, const StudySettings &settings, Console &console);

/// The study of a plan's text; null with the mistakes noted. `file` is what the messages call it.
using StudyMaker =
    std::function<std::unique_ptr<Study>(const std::string &plan, const std::string &file, Console &console)>;

/// Puts the units of several folders into a new one. Returns the exit status.
[[nodiscard]] int merge_studies(const std::vector<std::string> &folders, const StudyOutput &output,
                                const StudyMaker &make, Console &console);

}  // namespace redag::cli
