// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Measured values and what benchmarks report of them.
#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

#include "redag/base/time.hpp"

namespace redag_rclcpp::lab {

/// The median; 0 without values.
inline double median(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  return values.empty() ? 0 : values[values.size() / 2];
}

/// Durations in the order in which they were measured.
class Samples {
 public:
  void add(redag::Duration value) { values_.push_back(value); }
  [[nodiscard]] std::size_t size() const { return values_.size(); }

  /// The value in milliseconds that a share of the samples, from 0 to 1, does not exceed; 0 without samples.
  [[nodiscard]] double milliseconds(double share) const {
    if (values_.empty()) return 0;
    std::vector<redag::Duration> values = values_;
    const auto n = static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1));
    std::nth_element(values.begin(), values.begin() + n, values.end());
    return static_cast<double>(values[static_cast<std::size_t>(n)]) / redag::kMillisecond;
  }

 private:
  std::vector<redag::Duration> values_;
};

}  // namespace redag_rclcpp::lab
