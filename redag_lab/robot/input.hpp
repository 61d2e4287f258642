// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Reads a file that is a workload or a robot, for commands that take both. Reads files; otherwise pure.
#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "redag/base/result.hpp"
#include "redag/model/workload_yaml.hpp"
#include "redag_lab/robot/robot_yaml.hpp"

namespace redag::robot {

struct Input {
  std::optional<Robot> robot;  // none: the file is a workload
  Diagnostics warnings;
  // The workload, or the union of the robot's. Error: the robot is sound, but no workload says what it does.
  Result<LoadedWorkload> workload;
};

/// Reads a file. Errors: all its mistakes by line.
[[nodiscard]] Result<Input> load_input(const std::string &path, LoadOptions options = {});

/// The same for text in memory. `file` is its name in messages; its folder is where a robot's workloads are.
[[nodiscard]] Result<Input> parse_input(std::string_view text, const std::string &file, LoadOptions options = {});

/// Returns the workload of an input, with all warnings. Error: as Input::workload.
[[nodiscard]] Result<LoadedWorkload> as_workload(Input input);

}  // namespace redag::robot
