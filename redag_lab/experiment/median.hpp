// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The median of a sample with a distribution-free confidence interval between two of the sorted values. The number of
// values below the true median is binomially distributed. Pure.
#pragma once

#include <vector>

namespace redag::experiment {

struct Median {
  double median = 0;
  double low = 0;
  double high = 0;
  double confidence = 0;  // of [low, high]; at least 0.95 from six values on, otherwise of [least, largest]
};

/// Requires at least one value.
[[nodiscard]] Median median_of(std::vector<double> values);

}  // namespace redag::experiment
