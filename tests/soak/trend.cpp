// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "tests/soak/trend.hpp"

#include <algorithm>
#include <cstddef>

namespace redag::soak {

Trend trend_of(const std::vector<double> &values) {
  if (values.size() < 2) return {};
  std::vector<double> slopes;
  for (std::size_t i = 0; i < values.size(); ++i) {
    for (std::size_t k = i + 1; k < values.size(); ++k) {
      slopes.push_back((values[k] - values[i]) / static_cast<double>(k - i));
    }
  }
  const auto middle = slopes.begin() + static_cast<std::ptrdiff_t>(slopes.size() / 2);
  std::nth_element(slopes.begin(), middle, slopes.end());
  return {values.front(), values.back(), *middle * static_cast<double>(values.size() - 1)};
}

}  // namespace redag::soak
