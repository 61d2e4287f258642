// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Texts that the reports of `assign` and `tune` share. Pure functions.
#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "redag/model/workload.hpp"
#include "redag_lab/search/score.hpp"

namespace redag::cli {

/// "-2.5 ms"; "-" if nothing was seen.
[[nodiscard]] std::string lateness_text(const lab::Extremes &extremes);

/// "12.3 %", rounded down so as not to overstate it; "-" if nothing was seen.
[[nodiscard]] std::string slack_text(const lab::Extremes &extremes);

/// Returns "control 1, lidar none": max_active by DAG. A DAG of one task without a bound has no choice and is left out.
/// "-" if no DAG remains. Requires a bound for every DAG.
[[nodiscard]] std::string caps_text(const Workload &workload, std::span<const std::uint32_t> caps);

}  // namespace redag::cli
