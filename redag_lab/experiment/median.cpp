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
  // P(B = k) is mantissa * 2^exponent, step by step: 0.5^n alone is 0 for more than 1,074 values.
  double mantissa = 1;
  int exponent = -static_cast<int>(n);
  double below = std::ldexp(mantissa, exponent);
  std::size_t k = 1;
  double outside = 2 * below;
  while (k < n / 2) {
    int shift = 0;
    mantissa = std::frexp(mantissa * (static_cast<double>(n - k + 1) / static_cast<double>(k)), &shift);
    exponent += shift;
    const double term = std::ldexp(mantissa, exponent);
    if (2 * (below + term) > kMostOutside) break;
    below += term;
    outside = 2 * below;
    ++k;
  }
  const double middle = n % 2 == 1 ? values[n / 2] : (values[n / 2 - 1] + values[n / 2]) / 2;
  return Median{middle, values[k - 1], values[n - k], std::max(0.0, 1 - outside)};
}

}  // namespace redag::experiment
