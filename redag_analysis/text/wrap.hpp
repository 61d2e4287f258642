// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Breaks a text into lines for the terminal. Pure function.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>

namespace redag {

/// Breaks `text` at spaces, within `width` columns (0: no limit), and ends it with a newline. Lines after the first are
/// indented; the first one begins at that column, too. A word is never broken.
[[nodiscard]] std::string wrapped(std::string_view text, std::size_t indent, std::size_t width);

}  // namespace redag
