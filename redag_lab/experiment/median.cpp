// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/experiment/median.hpp"

#include <algorithm>
#include <cmath>

#include "redag/base/check.hpp"

namespace redag::experiment {

Median median_of(std::vector<double> values) {
  REDAG_CHECK(!values.empty(), "a median needs values");
  std::sort(values.begin(), values.end());
  const std::size_t n = values.size();
  // The true median is outside the k-th values from either end with probability 2 P(B(n, 1/2) < k).
  constexpr double kMostOutside = 0.05;
  double term = std::pow(0.5, static_cast<double>(n));  // P(B = 0); underflows for more than 1,074 values
  double below = term;
  std::size_t k = 1;
  double outside = 2 * below;
  while (k < n / 2) {
    term *= static_cast<double>(n - k + 1) / static_cast<double>(k);
    if (2 * (below + term) > kMostOutside) break;
    below += term;
    outside = 2 * below;
    ++k;
  }
  const double middle = n % 2 == 1 ? values[n / 2] : (values[n / 2 - 1] + values[n / 2]) / 2;
  return Median{middle, values[k - 1], values[n - k], std::max(0.0, 1 - outside)};
}

}  // namespace redag::experiment
