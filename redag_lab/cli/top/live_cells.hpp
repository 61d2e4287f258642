// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Cells of the tables of `redag top`. Pure functions.
#pragma once

#include <cstdint>
#include <string>

#include "redag/base/time.hpp"
#include "redag/live/page.hpp"
#include "redag_analysis/text/table.hpp"

namespace redag::cli {

/// For example "9.52" or "1250"; "-" without jobs.
[[nodiscard]] std::string rate_text(double rate);
[[nodiscard]] Cell time_cell(Duration time, Tint tint = Tint::Plain);
[[nodiscard]] Cell count_cell(std::uint64_t count, Tint tint = Tint::Plain);
/// All misses, and the recent ones: "23 +4".
[[nodiscard]] Cell missed_cell(const live::page::Figures &figures);

}  // namespace redag::cli
