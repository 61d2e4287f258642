// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// A histogram of durations with 8 buckets an octave: a percentile is at most 1/8 above the true one. Any thread; adding
// a value allocates nothing and takes no lock.
#pragma once

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <cstdint>

#include "redag/base/check.hpp"
#include "redag/base/log_buckets.hpp"
#include "redag/base/time.hpp"

namespace redag {

/// The content of a Histogram at some time. The difference of two is what came in between; sums combine histograms.
class HistogramCounts {
 public:
  static constexpr unsigned kBits = 3;  // 8 buckets an octave
  static constexpr unsigned kOctaves = 44;
  static constexpr std::size_t kBuckets = std::size_t{kOctaves} << kBits;

  [[nodiscard]] std::uint64_t total() const noexcept { return count_in(0, kBuckets); }
  /// The longest value ever added, even if these are the counts of a part.
  [[nodiscard]] Duration longest() const noexcept { return longest_; }

  /// How many values are in the buckets [first, last).
  [[nodiscard]] std::uint64_t count_in(std::size_t first, std::size_t last) const noexcept {
    std::uint64_t total = 0;
    for (std::size_t i = first; i < std::min(last, kBuckets); ++i) total += buckets_[i];
    return total;
  }

  /// Returns the smallest bound that at least `share` of the values do not exceed; 0 without values. `share` is from 0
  /// to 1.
  [[nodiscard]] Duration quantile(double share) const noexcept {
    REDAG_CHECK(share >= 0 && share <= 1, "a share of the values is from 0 to 1");
    constexpr double kRounding = 1e-6;  // 0.07 * 100 is more than 7
    const auto wanted = static_cast<std::uint64_t>(std::ceil(share * static_cast<double>(total()) - kRounding));
    std::uint64_t seen = 0;
    for (std::size_t i = 0; i < kBuckets; ++i) {
      seen += buckets_[i];
      if (seen > 0 && seen >= wanted) return std::min(longest_, upper_bound_of(i));
    }
    return 0;
  }

  HistogramCounts &operator+=(const HistogramCounts &other) noexcept {
    for (std::size_t i = 0; i < kBuckets; ++i) buckets_[i] += other.buckets_[i];
    longest_ = std::max(longest_, other.longest_);
    return *this;
  }
  /// `other` is an earlier state of the same histogram.
  HistogramCounts &operator-=(const HistogramCounts &other) noexcept {
    for (std::size_t i = 0; i < kBuckets; ++i) buckets_[i] -= other.buckets_[i];
    return *this;
  }

 private:
  friend class Histogram;

  using Buckets = LogBuckets<kBits>;

  static std::size_t bucket_of(std::uint64_t value) noexcept {
    return std::min(Buckets::bucket_of(value), kBuckets - 1);
  }
  static Duration upper_bound_of(std::size_t index) noexcept {
    // The last bucket takes all longer values.
    return index == kBuckets - 1 ? kNever : static_cast<Duration>(Buckets::highest_in(index));
  }

  std::array<std::uint64_t, kBuckets> buckets_{};
  Duration longest_ = 0;
};

class Histogram {
 public:
  void add(Duration value) noexcept {
    value = std::max<Duration>(value, 0);
    // Stored first: counts() must never include a value whose length longest_ does not cover yet.
    Duration longest = longest_.load(std::memory_order_relaxed);
    while (value > longest && !longest_.compare_exchange_weak(longest, value, std::memory_order_release)) {
    }
    buckets_[HistogramCounts::bucket_of(static_cast<std::uint64_t>(value))].fetch_add(1, std::memory_order_release);
  }

  [[nodiscard]] HistogramCounts counts() const noexcept {
    HistogramCounts counts;
    for (std::size_t i = 0; i < HistogramCounts::kBuckets; ++i) {
      counts.buckets_[i] = buckets_[i].load(std::memory_order_acquire);
    }
    counts.longest_ = longest();
    return counts;
  }

  [[nodiscard]] Duration longest() const noexcept { return longest_.load(std::memory_order_relaxed); }
  /// As HistogramCounts::quantile().
  [[nodiscard]] Duration quantile(double share) const noexcept { return counts().quantile(share); }

 private:
  std::array<std::atomic<std::uint64_t>, HistogramCounts::kBuckets> buckets_{};
  std::atomic<Duration> longest_{0};
};

}  // namespace redag
