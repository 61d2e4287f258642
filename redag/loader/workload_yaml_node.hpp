// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The steps of reading a workload, for readers of files that contain one, or may contain one. Pure.
#pragma once

#include <filesystem>
#include <string>

#include "redag/loader/workload_yaml.hpp"
#include "redag/loader/workload_yaml_tree.hpp"

namespace redag {

/// The same as parse_workload(), for a tree. Its nodes state their places in `file_name`.
[[nodiscard]] Result<LoadedWorkload> read_workload(const yaml::Node &root, std::string file_name,
                                                   LoadOptions options = {});

/// Gives a workload without a name that of its file, as load_workload() does.
void name_after(const std::filesystem::path &path, Workload &workload);

}  // namespace redag
