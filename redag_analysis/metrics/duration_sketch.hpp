// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Any number of durations in bounded memory. Values are exact up to a given number; beyond it they are counted in
// buckets at most 1/128 of their values wide (redag/base/log_buckets.hpp). Percentiles are then wrong by at most
// kRelativeError; count, minimum, mean and maximum stay exact. Merging the sketches of parts gives the sketch of the
// whole. Not thread-safe.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

#include "redag/base/int128.hpp"
#include "redag/base/log_buckets.hpp"
#include "redag_analysis/metrics/distribution.hpp"

namespace redag::metrics {

/// So many durations from `low` to `high`.
struct CountedDurations {
  Duration low = 0;
  Duration high = 0;
  std::uint64_t count = 0;

  friend bool operator==(const CountedDurations &, const CountedDurations &) = default;
};

class DurationSketch {
 public:
  using Buckets = LogBuckets<7>;
  /// Half a bucket, because a percentile is the middle of its bucket.
  static constexpr double kRelativeError = 1.0 / 256;

  /// `most_exact` is the number of values that are kept as they are, 8 bytes each. Beyond it a page of 16 buckets takes
  /// 136 bytes, and an octave takes 8 pages.
  explicit DurationSketch(std::size_t most_exact) : most_exact_(most_exact) {}

  /// Adds a value. A value below 0 counts as 0 in the percentiles.
  void add(Duration value);
  /// Merges another sketch. The result is exact if both are, whatever the number of values.
  void merge(const DurationSketch &other);

  [[nodiscard]] Distribution distribution() const;
  /// All values, in ascending ranges that do not overlap: equal values of an exact sketch, else those of a bucket.
  [[nodiscard]] std::vector<CountedDurations> counted() const;
  [[nodiscard]] std::uint64_t size() const { return is_exact() ? values_.size() : count_; }
  [[nodiscard]] bool is_exact() const { return pages_.empty(); }
  /// Heap memory in bytes.
  [[nodiscard]] std::size_t memory() const;

 private:
  static constexpr std::size_t kPageSize = 16;
  struct Page {
    std::size_t first = 0;  // its first bucket
    std::array<std::uint64_t, kPageSize> counts{};
  };

  void count(Duration value);
  void count_exact_values();
  Page &page_of(std::size_t bucket);
  [[nodiscard]] Duration percentile(double percent) const;

  std::size_t most_exact_;
  std::vector<Duration> values_;  // while exact
  std::vector<Page> pages_;       // by `first`; empty while exact
  std::size_t last_page_ = 0;     // the last one used, as values come in clusters
  // Figures of the values in `pages_`.
  std::uint64_t count_ = 0;
  Int128 sum_ = 0;
  Duration min_ = kNever;
  Duration max_ = std::numeric_limits<Duration>::min();
};

}  // namespace redag::metrics
