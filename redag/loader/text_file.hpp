// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Reads files into memory, for all readers of files. Any thread.
#pragma once

#include <cstddef>
#include <string>

#include "redag/base/result.hpp"

namespace redag {

/// The largest file that is read: an endless one (a device, a pipe) must not use all memory.
inline constexpr std::size_t kMaxFileBytes = std::size_t{8} << 30U;

/// Reads a whole file. Errors name the file.
[[nodiscard]] Result<std::string> read_file(const std::string &path, std::size_t most = kMaxFileBytes);
/// The same of an open file, which has this path: what has not been read of it.
[[nodiscard]] Result<std::string> read_rest(int descriptor, const std::string &path, std::size_t most = kMaxFileBytes);

/// Makes one error at a line of a file.
[[nodiscard]] tl::unexpected<Diagnostics> file_error(const std::string &file, int line, std::string message,
                                                     std::string hint = {});

}  // namespace redag
