// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// A small text file as one string, for the readers of YAML files. Reads at most what a reader accepts. Any thread.
#pragma once

#include <cstddef>
#include <filesystem>
#include <string>

#include "redag/base/result.hpp"

namespace redag {

/// The text of a file, or its first bytes where there are more than `most`: at least one more, so that the reader sees
/// that it is too long. `what` names the kind of file in messages: "a workload file".
[[nodiscard]] Result<std::string> read_text_file(const std::filesystem::path &path, const char *what, std::size_t most);

}  // namespace redag
