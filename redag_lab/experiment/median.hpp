// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The median of a sample with a confidence interval that assumes nothing about the distribution: between two of the
// sorted values, by the binomial distribution of how many lie below the true median. Pure.
#pragma once

#include <vector>

namespace redag::experiment {

struct Median {
  double median = 0;
  double low = 0;
  double high = 0;
  double confidence = 0;  // of [low, high]: at least 0.95 where there are six values or more, else as far as they go
};

/// Requires a value.
[[nodiscard]] Median median_of(std::vector<double> values);

}  // namespace redag::experiment
