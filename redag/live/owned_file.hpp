// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Files that only their owner can open. No state; any thread.
#pragma once

#include <string>

namespace redag::live {

/// The folder of pages, unless the user names another.
inline constexpr const char *kFolder = "/dev/shm";

/// Creates a new file for reading and writing. Returns its descriptor; negative, with errno, on an error.
[[nodiscard]] int create_owned_file(const std::string &path);

}  // namespace redag::live
