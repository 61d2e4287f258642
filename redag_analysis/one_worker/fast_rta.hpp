// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The exact test for bare numbers, for those who ask it of millions of task sets: one worker, full preemption,
// independent tasks, D <= T, no jitter, no blocking. The same answer as rta_preemptive, an order of magnitude faster.
#pragma once

#include <span>

#include "redag/base/time.hpp"

namespace redag::analysis {

struct SimpleTask {
  Duration wcet = 0;
  Duration period = 0;
  Duration deadline = 0;
};

/// Do all tasks, most urgent first, answer within their deadlines? Requires 0 < wcet, 0 < deadline <= period, and
/// periods below 2^50 ns (13 days). Pseudo-polynomial.
[[nodiscard]] bool is_schedulable(std::span<const SimpleTask> tasks);

}  // namespace redag::analysis
