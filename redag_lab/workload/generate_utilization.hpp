// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Draws vectors of utilizations with a given sum and a bound for each value, for generate.cpp. Pure, given the random
// generator.
#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "redag/derived/rng.hpp"

namespace redag::lab {

/// Draws uniformly from {u : sum u = total, 0 <= u_i <= upper_i}: Dirichlet-Rescale, D. Griffin, I. Bate, R. Davis,
/// "Generating Utilization Vectors for the Systematic Evaluation of Schedulability Tests", RTSS 2020. Requires
/// total > 0 and total <= sum upper. Returns nothing if rounding defeated every attempt.
[[nodiscard]] std::optional<std::vector<double>> drs(double total, const std::vector<double> &upper, Rng &rng);

}  // namespace redag::lab
