// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Reads a robot file (docs/robot.md) with the workloads that it names, and reports every mistake at its line. Knows
// what a file may say; what analysis needs besides is union.hpp's. Pure, except for the files that it reads.
#pragma once

#include <string>

#include "redag/base/result.hpp"
#include "redag/loader/workload_yaml.hpp"
#include "redag/loader/workload_yaml_tree.hpp"
#include "redag_lab/robot/robot.hpp"

namespace redag::robot {

struct LoadedRobot {
  Robot robot;
  Diagnostics warnings;
};

/// The most processes, and the most entries of threads and of interrupts.
inline constexpr std::size_t kMaxEntries = 1000;

/// True for the document of a robot file: a map with the key `robot`.
[[nodiscard]] bool is_robot(const yaml::Node &root);

/// Reads a robot. Workloads that it names by file are relative to the folder of `file`. Errors: all mistakes of all
/// these files.
[[nodiscard]] Result<LoadedRobot> read_robot(const yaml::Node &root, const std::string &file, LoadOptions options = {});

}  // namespace redag::robot
