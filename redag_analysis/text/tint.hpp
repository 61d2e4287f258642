// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Words in a terminal's colours, and the columns that a text takes. Pure functions.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

namespace redag {

enum class Tint : std::uint8_t { Plain, Good, Bad, Caution, Faint, Strong };

/// Wraps `text` in the terminal's codes for `tint`, or returns it unchanged if `colour` is false.
[[nodiscard]] std::string tinted(std::string_view text, Tint tint, bool colour);

/// Returns the number of columns of a UTF-8 text, one per code point. Codes of tinted() take none.
[[nodiscard]] std::size_t display_width(std::string_view text);

/// Returns at most `width` columns of `text`; the end of a longer text becomes "~".
[[nodiscard]] std::string cut(std::string_view text, std::size_t width);

}  // namespace redag
