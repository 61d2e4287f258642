// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Reads text that is a workload or a robot, for commands that take both. Pure, except for files that a robot names.
#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "redag/base/result.hpp"
#include "redag/loader/workload_yaml.hpp"
#include "redag_lab/robot/robot_yaml.hpp"

namespace redag::robot {

struct Input {
  LoadedWorkload loaded;       // the workload, or the union of the robot's
  std::optional<Robot> robot;  // none: the file is a workload
};

/// Reads a text. `file` is its name in messages; its folder is where a robot's workloads are. Errors: all its mistakes
/// by line.
[[nodiscard]] Result<Input> parse_input(std::string_view text, const std::string &file, LoadOptions options = {});

}  // namespace redag::robot
