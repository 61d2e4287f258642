// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// A folder in memory for readers that take paths. It is removed when the process ends normally.
#pragma once

#include <string>
#include <string_view>

namespace redag::fuzz {

/// Returns the path of the folder, which the first call creates.
[[nodiscard]] const std::string &scratch_folder();

/// Writes a file into the folder, readable by its owner only, and returns its path.
std::string scratch_file(std::string_view name, std::string_view content);

}  // namespace redag::fuzz
