// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Lines of text with tints: what a screen shows, before a terminal's codes. Values and pure functions.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "redag_analysis/text/tint.hpp"

namespace redag::cli {

struct Span {
  std::string text;
  Tint tint = Tint::Plain;
  bool reversed = false;  // the colours of text and background change places
};

using Line = std::vector<Span>;

[[nodiscard]] std::size_t width_of(const Line &line);

/// Returns the text without tints, and without blanks at its end.
[[nodiscard]] std::string plain(const Line &line);

/// As plain(), with the terminal's codes if `colour` is true.
[[nodiscard]] std::string with_codes(const Line &line, bool colour);

/// Returns at most `width` columns of `line`; the end of a longer one becomes "…".
[[nodiscard]] Line cut(Line line, std::size_t width);

/// Returns `line` with blanks up to `width`, all of it reversed.
[[nodiscard]] Line reversed(Line line, std::size_t width);

/// Returns at most `width` columns of `text`. The middle of a longer text becomes "…": names often differ at the end.
[[nodiscard]] std::string cut_middle(std::string_view text, std::size_t width);

/// Returns `text` with blanks before or after it, up to `width` columns.
[[nodiscard]] std::string padded(std::string text, std::size_t width, bool right);

}  // namespace redag::cli
