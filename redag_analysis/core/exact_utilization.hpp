// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Compares utilizations with the limits of the tests, as rational numbers: rounding neither accepts nor refuses a set.
// Intervals of 2^-60 decide; where they do not, whole numbers of any length do. Pure functions.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "redag/base/int128.hpp"
#include "redag/base/time.hpp"

namespace redag::analysis {

/// A utilization: amount / period.
struct Share {
  Uint128 amount = 0;  // below 2^80
  Duration period = 1;
};

/// An interval between two multiples of 2^-60, stored as their numerators.
struct ShareRange {
  Uint128 low = 0;
  Uint128 high = 0;
};

/// A stack of shares, with their sum and product.
class Shares {
 public:
  void push(const Share &share);
  void pop();
  [[nodiscard]] std::span<const Share> all() const { return all_; }
  [[nodiscard]] std::size_t size() const { return all_.size(); }
  [[nodiscard]] ShareRange sum() const { return sums_.back(); }
  [[nodiscard]] ShareRange product() const { return products_.back(); }  // of (1 + share)

 private:
  static constexpr ShareRange kOnes = {Uint128{1} << 60U, Uint128{1} << 60U};

  std::vector<Share> all_;
  std::vector<ShareRange> sums_ = {ShareRange{}};  // of the first 0, 1, ... shares
  std::vector<ShareRange> products_ = {kOnes};
};

// The comparisons below answer no if intervals do not decide and the numbers have more than 2^18 bits. This takes
// thousands of different, unrelated periods.

/// True if sum <= limit / of.
[[nodiscard]] bool is_sum_within(const Shares &shares, std::uint64_t limit, std::uint64_t of);

/// True if sum <= n (2^(1/n) - 1), that is (1 + sum / n)^n <= 2. n = 0 counts as n = 1.
[[nodiscard]] bool is_within_liu_layland(const Shares &shares, std::size_t n);

/// True if prod (1 + share) <= 2.
[[nodiscard]] bool is_within_hyperbolic(const Shares &shares);

/// True if a < b.
[[nodiscard]] bool is_smaller(const Share &a, const Share &b);

/// Returns n (2^(1/n) - 1) in units of 2^-60, rounded down by at most 2^-50.
[[nodiscard]] Int128 liu_layland_limit(std::size_t n);

}  // namespace redag::analysis
