// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Numbers as text for people, the same in tables, verdicts and pages; and what is asked of texts from outside before
// they are parsed. Pure functions.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

namespace redag {

/// A share of one: 0.1421 -> "14.2 %"; "-" if nothing was counted (not finite). Never reads as none, or as all, where
/// it is not.
[[nodiscard]] std::string format_percent(double ratio);

/// 1234567 -> "1 234 567".
[[nodiscard]] std::string format_count(std::uint64_t count);

/// A share in a sentence: "14.2 %", below 1 % with what was counted: "0.0043 % (1 of 23 326)"; "none" of `whole`, and
/// "-" where `whole` is 0.
[[nodiscard]] std::string format_share(std::uint64_t part, std::uint64_t whole);

/// The same in a table with a column for `whole`: "0", "1 (0.0043 %)"; "-" where `whole` is 0.
[[nodiscard]] std::string format_count_and_share(std::uint64_t part, std::uint64_t whole);

inline constexpr const char *kMaxDurationText = "1281023h (146 years)";  // kMaxDuration, for messages

/// Length of the UTF-8 sequence at `at`, 0 if there is none (overlong forms, surrogates and beyond U+10FFFF included).
[[nodiscard]] std::size_t utf8_length(std::string_view text, std::size_t at);

/// The first character that a terminal would obey instead of showing, as "U+001B": controls (C0, DEL, C1), line
/// separators, marks that reverse the direction of text. "byte 0xFF" for what is not UTF-8. Empty: all can be shown.
[[nodiscard]] std::string find_unprintable(std::string_view text);

/// `text` with each character that find_unprintable() finds written out: "\\u{1B}[2J". Line feeds and tabs stay.
[[nodiscard]] std::string printable(std::string_view text);

/// What somebody wrote, as a message quotes it: in quotes, printable, and of a long text the beginning.
[[nodiscard]] std::string in_quotes(std::string_view text);

/// No JSON that this project writes is nested as deep.
inline constexpr std::size_t kMaxJsonDepth = 32;

/// Are there more than `levels` arrays and objects inside one another? What copies or prints a tree of JSON calls
/// itself once a level: ask before parsing what others wrote. Of a text that is not JSON, any answer.
[[nodiscard]] bool json_nests_deeper(std::string_view json, std::size_t levels = kMaxJsonDepth);

}  // namespace redag
