// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/experiment/grid.hpp"

#include <algorithm>
#include <utility>

#include <fmt/format.h>

#include "redag/derived/rng.hpp"

namespace redag::experiment {

std::uint64_t count_combinations(const std::vector<Factor> &factors, std::uint64_t most) {
  std::uint64_t count = 1;
  for (const Factor &factor : factors) {
    const std::uint64_t levels = std::max<std::size_t>(1, factor.levels.size());
    if (levels > most / count) return most + 1;
    count *= levels;
  }
  return count;
}

std::vector<Point> points_of(const std::vector<Factor> &factors, const Affects &affects) {
  std::vector<Point> points;
  Point point;
  for (const Factor &factor : factors) point.push_back(factor.levels.empty() ? kNoLevel : 0);
  while (true) {
    // The first of several equal combinations represents them.
    Point clean = point;
    bool is_first = true;
    for (std::size_t f = 0; f < factors.size(); ++f) {
      if (clean[f] == kNoLevel || affects(f, point)) continue;
      is_first = is_first && clean[f] == 0;
      clean[f] = kNoLevel;
    }
    if (is_first) points.push_back(std::move(clean));
    std::size_t f = factors.size();
    while (f > 0) {
      --f;
      if (point[f] != kNoLevel) {
        if (++point[f] < factors[f].levels.size()) break;
        point[f] = 0;
      }
      if (f == 0) return points;
    }
  }
}

std::string describe(const std::vector<Factor> &factors, const Point &point) {
  std::string text;
  for (std::size_t f = 0; f < factors.size(); ++f) {
    if (point[f] == kNoLevel) continue;
    text += fmt::format("{}{} {}", text.empty() ? "" : ", ", factors[f].name, factors[f].levels[point[f]]);
  }
  return text;
}

std::uint64_t derive_seed(std::uint64_t seed, std::initializer_list<std::uint64_t> coordinates) {
  std::uint64_t derived = mix(seed);
  for (const std::uint64_t coordinate : coordinates) derived = mix(derived ^ mix(coordinate + 1));
  return derived;
}

}  // namespace redag::experiment
