// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/sched/degradation.hpp"

#include <cmath>

#include "redag/base/int128.hpp"

namespace redag::sched {

bool lets_through(const Degrade &degrade, Duration period, Time last, Time release) {
  if (degrade.kind == Degrade::Kind::Stop) return false;
  if (last == kNoRelease) return true;
  const bool skips = degrade.kind == Degrade::Kind::Skip;
  const Int128 distance = Int128{release} - last;
  if (distance > 0) {
    // Counts periods instead of releases: messages follow no grid and need not arrive exactly one period apart.
    if (skips) return distance > Int128{degrade.skip} * period + period / 2;
    return distance >= static_cast<Int128>(std::ceil(degrade.stretch * static_cast<double>(period)));
  }
  // This release was seen after a newer one of another task on its grid. That newer one fixed the choice.
  const Int128 of_these_one = skips ? Int128{degrade.skip} + 1 : static_cast<Int128>(std::ceil(degrade.stretch));
  return -distance % (of_these_one * period) == 0;
}

}  // namespace redag::sched
