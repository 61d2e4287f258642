// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Reads the input of a command that takes a workload or a robot. Not thread-safe.
#pragma once

#include <string>

#include "redag_lab/robot/input.hpp"

namespace redag::cli {

/// Reads a file, or standard input if `path` is "-". Leaves its text in `source`, if that is given.
[[nodiscard]] Result<robot::Input> load_workload_or_robot(const std::string &path, LoadOptions options = {},
                                                          std::string *source = nullptr);

}  // namespace redag::cli
