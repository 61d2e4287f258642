// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Numbers as text for people, the same in tables, verdicts and pages. Also checks of texts from outside, before they
// are parsed. Pure functions.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

namespace redag {

/// Formats a ratio: 0.1421 -> "14.2 %"; "-" if it is not finite (nothing was counted). Never shows a ratio above 0 as
/// 0, or one below 1 as 100 %.
[[nodiscard]] std::string format_percent(double ratio);

/// 1234567 -> "1 234 567".
[[nodiscard]] std::string format_count(std::uint64_t count);

/// Formats a share for a sentence: "14.2 %"; below 1 % with its counts: "0.0043 % (1 of 23 326)"; "none" if `part` is
/// 0; "-" if `whole` is 0.
[[nodiscard]] std::string format_share(std::uint64_t part, std::uint64_t whole);

/// The same for a table with a column for `whole`: "0", "1 (0.0043 %)"; "-" if `whole` is 0.
[[nodiscard]] std::string format_count_and_share(std::uint64_t part, std::uint64_t whole);

inline constexpr const char *kMaxDurationText = "1281023h (146 years)";  // kMaxDuration, for messages

/// Length of the UTF-8 sequence at `at`; 0: invalid (also overlong forms, surrogates, and beyond U+10FFFF).
[[nodiscard]] std::size_t utf8_length(std::string_view text, std::size_t at);

/// The code of the one character that `sequence` is. Requires valid UTF-8.
[[nodiscard]] char32_t code_point(std::string_view sequence);

/// Returns the first character that a terminal would obey instead of show, as "U+001B": controls (C0, DEL, C1), line
/// separators, marks that reverse the direction of text. Returns "byte 0xFF" for a byte that is not UTF-8. Empty: all
/// can be shown.
[[nodiscard]] std::string find_unprintable(std::string_view text);

/// Returns `text` with each character that find_unprintable() finds written out: "\\u{1B}[2J". Keeps those of `kept`.
[[nodiscard]] std::string printable(std::string_view text, std::string_view kept = "\n\t");

/// Quotes a user's text for a message: in quotes, printable, and cut if it is long.
[[nodiscard]] std::string in_quotes(std::string_view text);

/// The deepest nesting in JSON that is read. JSON that this project writes is less deep.
inline constexpr std::size_t kMaxJsonDepth = 32;

/// The most values and keys in JSON that is read. A tree takes up to a hundred bytes for each.
inline constexpr std::size_t kMaxJsonValues = std::size_t{1} << 20U;

/// Returns true if more than `levels` arrays and objects are nested, or if there are more than `values` values. Code
/// that copies or prints a JSON tree recurses once a level: call this before parsing JSON from others. For text that is
/// not JSON the answer is undefined.
[[nodiscard]] bool json_is_too_large(std::string_view json, std::size_t levels = kMaxJsonDepth,
                                     std::size_t values = kMaxJsonValues);

}  // namespace redag
