// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Breaks text into lines for the terminal, at spaces. A word is never broken. Pure functions.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

namespace redag {

/// Returns the lines of `text` within `width` columns (0: no limit). At least one line, which may be empty.
[[nodiscard]] std::vector<std::string> lines_within(std::string_view text, std::size_t width);

/// Breaks `text` within `width` columns (0: no limit), and ends it with a newline. Lines after the first are indented;
/// the first one begins at that column, too.
[[nodiscard]] std::string wrapped(std::string_view text, std::size_t indent, std::size_t width);

/// Breaks those lines of a document that are wider than `width` columns (0: no limit), and leaves the others as they
/// are. The rest of a broken line is indented by two columns more than the line.
[[nodiscard]] std::string fitted(std::string_view document, std::size_t width);

}  // namespace redag
