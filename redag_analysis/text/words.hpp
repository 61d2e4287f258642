// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// English for counts and lists, the same in messages, tables and pages. Pure functions.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace redag {

/// Returns the count with its noun: "1 job", "2 000 jobs". `many` is the plural of a noun that does not take an "s".
[[nodiscard]] std::string plural(std::uint64_t count, std::string_view noun, std::string_view many = {});

/// Joins names for a sentence: "a", "a and b", "a, b and c".
[[nodiscard]] std::string join(const std::vector<std::string> &names);

/// Joins the first `most` names, and counts the rest: "a, b and 1 other", "a, b and 2 others".
[[nodiscard]] std::string join_first(std::vector<std::string> names, std::size_t most);

}  // namespace redag
