// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// "Did you mean": finds the name nearest to a mistyped one. Pure functions.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace redag {

/// Returns how many edits (insert, delete or replace a byte) turn one text into the other (Levenshtein). Gives up
/// beyond `limit` and returns limit + 1.
[[nodiscard]] std::size_t edit_distance(std::string_view a, std::string_view b, std::size_t limit);

/// Returns the nearest candidate within three edits and half the length of `name`; empty: none, or several equally far.
[[nodiscard]] std::string_view nearest(std::string_view name, const std::vector<std::string_view> &candidates);

/// Returns the nearest candidate as "did you mean 'x'?", or else the list "one of a, b, c".
[[nodiscard]] std::string suggestion(std::string_view given, const std::vector<std::string> &candidates);

}  // namespace redag
