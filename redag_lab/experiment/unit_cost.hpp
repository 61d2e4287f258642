// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// What an experiment costs, measured on some of its units. They are spread evenly over the plan, because units of one
// point cost about the same.
#pragma once

#include <cstdint>
#include <functional>

#include "redag/base/result.hpp"
#include "redag/base/time.hpp"
#include "redag_lab/experiment/runner.hpp"

namespace redag::experiment {

struct UnitCost {
  std::uint64_t measured = 0;  // units
  double mean = 0;             // ns of a processor, for a unit
  double error = 0;            // half the width of the mean's interval of 95 % confidence
};

/// Evaluates units of `count`, all different, until `effort` is used up, or once all are measured. `clock` tells the
/// time that this thread has had a processor. Stops early once `stop` is true. Error: that of `evaluate`.
[[nodiscard]] Result<UnitCost> measure_cost(std::uint64_t count, Duration effort, const Evaluate &evaluate,
                                            const std::function<Time()> &clock, const std::atomic<bool> &stop);

/// Returns the processor time of the calling thread.
[[nodiscard]] Time thread_time();

}  // namespace redag::experiment
