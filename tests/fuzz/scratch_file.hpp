// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// A folder of the process in memory, for readers that take paths; removed when the process ends as it should.
#pragma once

#include <string>
#include <string_view>

namespace redag::fuzz {

/// The folder, made at the first call.
[[nodiscard]] const std::string &scratch_folder();

/// Writes a file in it, which only its owner can read, and returns its path.
std::string scratch_file(std::string_view name, std::string_view content);

}  // namespace redag::fuzz
