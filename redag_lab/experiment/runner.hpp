// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Runs the units of an experiment on several processors (oneTBB) and hands the results over one at a time, in the order
// of the units, whichever finished first: what is written is the same for every number of jobs.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <span>
#include <string>

#include "redag/base/result.hpp"

namespace redag::experiment {

/// One unit's result, one line of text. Called from several threads at once; a pure function of the unit.
using Evaluate = std::function<Result<std::string>(std::uint64_t unit)>;
/// Receives the results in order, one call at a time, from any thread.
using Accept = std::function<Result<void>(std::uint64_t unit, const std::string &result)>;

struct RunnerOptions {
  std::uint32_t jobs = 1;                   // units evaluated at the same time
  const std::atomic<bool> *stop = nullptr;  // once true, units that have not begun are left out
};

/// How many units were accepted: a prefix of `units`, all of them unless stopped. Error: the first one of `evaluate` or
/// `accept`, in the order of the units; those before it were accepted.
[[nodiscard]] Result<std::uint64_t> run_units(std::span<const std::uint64_t> units, const RunnerOptions &options,
                                              const Evaluate &evaluate, const Accept &accept);

}  // namespace redag::experiment
