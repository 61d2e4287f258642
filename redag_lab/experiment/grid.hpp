// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The grid of an experiment: every combination of the levels of its factors, numbered. Pure functions.
#pragma once

#include <cstdint>
#include <functional>
#include <limits>
#include <string>
#include <vector>

namespace redag::experiment {

/// Numbers with a fraction are in millionths in plans, which are exact on every machine.
inline constexpr std::uint32_t kMillion = 1'000'000;
[[nodiscard]] constexpr double share(std::uint32_t millionths) { return millionths / double{kMillion}; }

/// A factor without levels is not varied.
struct Factor {
  std::string name;
  std::vector<std::string> levels;  // as displayed
  bool numeric = false;
};

/// A level of each factor. It is kNoLevel where the factor is not varied, or does not affect this point.
using Point = std::vector<std::uint32_t>;
inline constexpr std::uint32_t kNoLevel = std::numeric_limits<std::uint32_t>::max();

/// Returns the number of combinations without creating them; at most `most` + 1.
[[nodiscard]] std::uint64_t count_combinations(const std::vector<Factor> &factors, std::uint64_t most);

/// Returns every combination once, as nested loops: the last factor changes fastest. Combinations that differ only in
/// factors that do not affect them are equal.
using Affects = std::function<bool(std::size_t factor, const Point &point)>;
[[nodiscard]] std::vector<Point> points_of(const std::vector<Factor> &factors, const Affects &affects);

/// Describes a point for messages: "workers 4, executor mte".
[[nodiscard]] std::string describe(const std::vector<Factor> &factors, const Point &point);

/// Derives the seed of the coordinates, in this order. A unit's seed follows from its definition, not from the number
/// of other units.
[[nodiscard]] std::uint64_t derive_seed(std::uint64_t seed, std::initializer_list<std::uint64_t> coordinates);

/// Returns one text for each value.
template <class Values, class Text>
[[nodiscard]] std::vector<std::string> texts(const Values &values, Text text) {
  std::vector<std::string> result;
  for (const auto &value : values) result.emplace_back(text(value));
  return result;
}

}  // namespace redag::experiment
