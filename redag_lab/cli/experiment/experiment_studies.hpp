// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The subcommands of `redag experiment` that run a study, and the functions that make studies of their plans, for
// merging.
#pragma once

#include <CLI/CLI.hpp>
#include <memory>
#include <string>
#include <vector>

#include "redag_lab/cli/experiment/experiment_study.hpp"
#include "redag_lab/cli/terminal/commands.hpp"
#include "redag_lab/experiment/factorial_plan.hpp"

namespace redag::cli {

[[nodiscard]] Action add_acceptance(CLI::App &app);
[[nodiscard]] std::unique_ptr<Study> make_acceptance(const std::string &plan, const std::string &file,
                                                     Console &console);

[[nodiscard]] Action add_factorial(CLI::App &app);
/// Returns the executors that plans can name (experiment::ExecutorNames).
[[nodiscard]] std::vector<std::string> executors_of(experiment::World world);
[[nodiscard]] std::unique_ptr<Study> make_factorial(const std::string &plan, const std::string &file, Console &console);

/// Makes the study of a plan of any kind, which its key `experiment` names. Returns null after printing the mistakes.
[[nodiscard]] std::unique_ptr<Study> make_study(const std::string &plan, const std::string &file, Console &console);

[[nodiscard]] Action add_cost(CLI::App &app);
[[nodiscard]] Action add_submit(CLI::App &app);

}  // namespace redag::cli
