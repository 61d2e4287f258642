// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The search of `tune`, over points with one of several values in each dimension. Small spaces are tried completely. In
// larger ones, one dimension at a time moves to its best value until nothing improves, from several starts. Points are
// scored in batches, which can run in parallel without effect on the result. Pure, apart from the callbacks.
#pragma once

#include <algorithm>
#include <cstdint>
#include <functional>
#include <map>
#include <span>
#include <utility>
#include <vector>

#include "redag_lab/search/score.hpp"

namespace redag::lab {

/// One value for each dimension.
using Point = std::vector<std::uint32_t>;

struct SearchSpace {
  std::vector<std::vector<std::uint32_t>> values;  // of each dimension; not empty
  std::vector<Point> starts;                       // of the local search; the first is the present point

  /// Returns the number of points, or `limit` + 1 if there are more than `limit`.
  [[nodiscard]] std::uint64_t size(std::uint64_t limit) const {
    std::uint64_t product = 1;
    for (const auto &choices : values) {
      product *= choices.size();
      if (product > limit) return limit + 1;
    }
    return product;
  }
};

class CoordinateSearch {
 public:
  /// Returns the scores of the points, in their order. Fewer scores than points end the search.
  using Evaluate = std::function<std::vector<Score>(std::span<const Point>)>;
  using Better = std::function<bool(const Score &, const Score &)>;  // a strict weak order

  struct Found {
    Point best;  // the first met of equally good ones
    Score score{};
    std::map<Point, Score> trials;
    bool exhaustive = true;
    bool stopped = false;
  };

  CoordinateSearch(Evaluate evaluate, Better better) : evaluate_(std::move(evaluate)), better_(std::move(better)) {}

  /// Runs the search; a space of at most `exhaustive` points is tried completely. Requires a start. If it is stopped
  /// before the start is scored, there are no trials.
  Found run(const SearchSpace &space, std::uint64_t exhaustive) {
    found_ = {};
    found_.best = space.starts.front();
    try_points({space.starts.front()});
    if (found_.stopped) return std::move(found_);
    if (space.size(exhaustive) <= exhaustive) {
      try_all(space);
    } else {
      found_.exhaustive = false;
      for (const Point &start : space.starts) climb(space, start);
    }
    return std::move(found_);
  }

 private:
  static constexpr std::size_t kBatch = 64;

  // Scores the points that have no score yet.
  void try_points(const std::vector<Point> &points) {
    std::vector<Point> unknown;
    for (const Point &point : points) {
      const bool listed = std::find(unknown.begin(), unknown.end(), point) != unknown.end();
      if (!listed && found_.trials.find(point) == found_.trials.end()) unknown.push_back(point);
    }
    if (unknown.empty() || found_.stopped) return;
    const std::vector<Score> scores = evaluate_(unknown);
    for (std::size_t i = 0; i < scores.size(); ++i) {
      if (found_.trials.empty() || better_(scores[i], found_.score)) {
        found_.best = unknown[i];
        found_.score = scores[i];
      }
      found_.trials.emplace(unknown[i], scores[i]);
    }
    found_.stopped = scores.size() < unknown.size();
  }

  void try_all(const SearchSpace &space) {
    std::vector<std::size_t> at(space.values.size(), 0);
    std::vector<Point> batch;
    bool more = true;
    while (more && !found_.stopped) {
      Point point;
      for (std::size_t d = 0; d < at.size(); ++d) point.push_back(space.values[d][at[d]]);
      batch.push_back(std::move(point));
      std::size_t d = 0;
      while (d < at.size() && ++at[d] == space.values[d].size()) at[d++] = 0;
      more = d < at.size();
      if (more && batch.size() < kBatch) continue;
      try_points(batch);
      batch.clear();
    }
  }

  void climb(const SearchSpace &space, Point here) {
    try_points({here});
    bool changed = true;
    while (changed && !found_.stopped) {
      changed = false;
      for (std::size_t d = 0; d < space.values.size() && !found_.stopped; ++d) {
        std::vector<Point> line;
        for (const std::uint32_t value : space.values[d]) {
          line.push_back(here);
          line.back()[d] = value;
        }
        try_points(line);
        if (found_.stopped) return;
        for (const Point &point : line) {
          if (!better_(found_.trials.at(point), found_.trials.at(here))) continue;
          here = point;
          changed = true;
        }
      }
    }
  }

  Evaluate evaluate_;
  Better better_;
  Found found_;
};

}  // namespace redag::lab
