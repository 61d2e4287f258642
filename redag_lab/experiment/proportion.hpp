// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// A share of a sample with its confidence interval. Pure.
#pragma once

#include <cstdint>

namespace redag::experiment {

struct Proportion {
  double ratio = 0;
  double low = 0;  // 95 % confidence
  double high = 1;
};

/// Returns `hits` / `trials` with the score interval of E. B. Wilson, JASA 22(158), 1927. The interval stays within [0,
/// 1] and has a length even where no trial or every trial hits. Requires hits <= trials. Without trials the interval is
/// [0, 1].
[[nodiscard]] Proportion proportion(std::uint64_t hits, std::uint64_t trials);

}  // namespace redag::experiment
