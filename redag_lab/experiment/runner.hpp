// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Runs the units of an experiment on several processors (oneTBB). Hands over the results one at a time, in the order of
// the units. The output is therefore the same for every number of jobs.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <span>
#include <string>

#include "redag/base/result.hpp"

namespace redag::experiment {

/// Returns a unit's result, one line of text. Several threads call it at once; it must be a pure function of the unit.
using Evaluate = std::function<Result<std::string>(std::uint64_t unit)>;
/// Receives the results in order, one call at a time, on any thread.
using Accept = std::function<Result<void>(std::uint64_t unit, const std::string &result)>;

struct RunnerOptions {
  std::uint32_t jobs = 1;                   // units evaluated at the same time
  const std::atomic<bool> *stop = nullptr;  // once true, units that have not begun are left out
};

/// Returns the number of accepted units. They are a prefix of `units`, and all of them unless stopped. Error: the first
/// one of `evaluate` or `accept`, in the order of the units; earlier units were accepted.
[[nodiscard]] Result<std::uint64_t> run_units(std::span<const std::uint64_t> units, const RunnerOptions &options,
                                              const Evaluate &evaluate, const Accept &accept);

}  // namespace redag::experiment
