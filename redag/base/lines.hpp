// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Splits text into lines, for readers of files and messages. Pure functions.
#pragma once

#include <string_view>

namespace redag {

/// Takes the first line off `text`, and returns it without its line feed. The last line needs none. Requires text.
[[nodiscard]] constexpr std::string_view next_line(std::string_view &text) {
  const std::string_view line = text.substr(0, text.find('\n'));
  text.remove_prefix(line.size() < text.size() ? line.size() + 1 : text.size());
  return line;
}

}  // namespace redag
