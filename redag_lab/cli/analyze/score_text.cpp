// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/cli/analyze/score_text.hpp"

#include <fmt/format.h>

#include <cmath>

#include "redag/base/text.hpp"

namespace redag::cli {

std::string lateness_text(const lab::Extremes &extremes) {
  if (!extremes.any) return "-";
  const Duration lateness = extremes.worst_lateness;
  return lateness < 0 ? "-" + humanize_duration(-lateness) : humanize_duration(lateness);
}

std::string slack_text(const lab::Extremes &extremes) {
  return extremes.any ? fmt::format("{:.1f} %", std::floor(extremes.least_slack * 1000 + 1e-9) / 10) : "-";
}

}  // namespace redag::cli
