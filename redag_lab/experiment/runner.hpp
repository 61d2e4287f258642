// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Runs the units of an experiment on several processors (oneTBB). Hands over the results one at a time, in the order of
// the units. The output is therefore the same for every number of jobs.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "redag/base/result.hpp"
#include "redag_lab/experiment/finished_unit.hpp"

namespace redag::experiment {

/// Returns the next unit to do; nothing at the end.
using NextUnit = std::function<std::optional<std::uint64_t>()>;
/// Returns a unit's result, one line of text. Several threads call it at once; it must be a pure function of the unit.
using Evaluate = std::function<Result<std::string>(std::uint64_t unit)>;

struct RunnerOptions {
  std::uint32_t jobs = 1;                   // units evaluated at the same time
  const std::atomic<bool> *stop = nullptr;  // once true, units that have not begun are left out
};

/// Returns the number of accepted units. They are the first that `next` returned, and all of them unless stopped.
/// Error: the first one of `evaluate` or `accept`, in the order of the units; earlier units were accepted.
[[nodiscard]] Result<std::uint64_t> run_units(const NextUnit &next, const RunnerOptions &options,
                                              const Evaluate &evaluate, const Accept &accept);
/// Returns the units of a list one by one.
[[nodiscard]] NextUnit units_of(std::vector<std::uint64_t> units);

}  // namespace redag::experiment
