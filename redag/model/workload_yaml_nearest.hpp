// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// "Did you mean": the name nearest to a mistyped one. Pure.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace redag::yaml {

/// Edits (insert, delete, replace a byte) that turn one text into the other (Levenshtein); gives up beyond `limit` and
/// returns limit + 1.
[[nodiscard]] std::size_t edit_distance(std::string_view a, std::string_view b, std::size_t limit);

/// The candidate within half the length of `name` and three edits, the first of the nearest; empty if there is none.
[[nodiscard]] std::string_view nearest(std::string_view name, const std::vector<std::string_view> &candidates);

}  // namespace redag::yaml
