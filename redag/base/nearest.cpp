// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/base/nearest.hpp"

#include <algorithm>

#include <fmt/format.h>
#include <numeric>

namespace redag {

std::size_t edit_distance(std::string_view a, std::string_view b, std::size_t limit) {
  const std::size_t longer = std::max(a.size(), b.size());
  if (longer - std::min(a.size(), b.size()) > limit) return limit + 1;
  std::vector<std::size_t> row(b.size() + 1);
  std::iota(row.begin(), row.end(), std::size_t{0});
  for (std::size_t i = 1; i <= a.size(); ++i) {
    std::size_t diagonal = row[0];
    row[0] = i;
    for (std::size_t j = 1; j <= b.size(); ++j) {
      const std::size_t replaced = diagonal + (a[i - 1] == b[j - 1] ? 0 : 1);
      diagonal = row[j];
      row[j] = std::min({replaced, row[j] + 1, row[j - 1] + 1});
    }
  }
  return std::min(row.back(), limit + 1);
}

std::string_view nearest(std::string_view name, const std::vector<std::string_view> &candidates) {
  std::size_t limit = std::min<std::size_t>(name.size() / 2, 3);
  std::string_view best;
  bool is_tied = false;
  for (const std::string_view candidate : candidates) {
    const std::size_t distance = edit_distance(name, candidate, limit);
    if (distance > limit) continue;
    is_tied = !best.empty() && distance == limit;
    best = candidate;
    if (distance <= 1) return best;
    limit = distance;
  }
  return is_tied ? std::string_view() : best;
}

std::string suggestion(std::string_view given, const std::vector<std::string> &candidates) {
  const std::vector<std::string_view> views(candidates.begin(), candidates.end());
  const std::string_view best = nearest(given, views);
  if (!best.empty()) return "did you mean '" + std::string(best) + "'?";
  constexpr std::size_t kMostNamed = 20;
  std::string all;
  for (std::size_t i = 0; i < std::min(candidates.size(), kMostNamed); ++i) {
    all += (i == 0 ? "one of " : ", ") + candidates[i];
  }
  if (candidates.size() > kMostNamed) all += fmt::format(" and {} more", candidates.size() - kMostNamed);
  return all;
}

}  // namespace redag
