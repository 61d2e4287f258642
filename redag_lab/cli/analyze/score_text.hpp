// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Texts that the reports of `assign` and `tune` share. Pure functions.
#pragma once

#include <string>

#include "redag_lab/search/score.hpp"

namespace redag::cli {

/// "-2.5 ms"; "-" if nothing was seen.
[[nodiscard]] std::string lateness_text(const lab::Extremes &extremes);

/// "12.3 %", rounded down so as not to overstate it; "-" if nothing was seen.
[[nodiscard]] std::string slack_text(const lab::Extremes &extremes);

}  // namespace redag::cli
