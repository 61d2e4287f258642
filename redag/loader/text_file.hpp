// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Reads a small text file into one string, for the readers of YAML files. Any thread.
#pragma once

#include <cstddef>
#include <filesystem>
#include <string>

#include "redag/base/result.hpp"

namespace redag {

/// Returns the text of a file. From a file longer than `most` bytes it returns a part that is also longer, so that the
/// reader sees that the file is too long. `what` names the kind of file in messages: "a workload file".
[[nodiscard]] Result<std::string> read_text_file(const std::filesystem::path &path, const char *what, std::size_t most);

}  // namespace redag
