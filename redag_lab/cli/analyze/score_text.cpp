// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/cli/analyze/score_text.hpp"

#include <fmt/format.h>

#include <cmath>

#include "redag/base/text.hpp"
#include "redag_lab/workload/changes.hpp"

namespace redag::cli {

std::string lateness_text(const lab::Extremes &extremes) {
  if (!extremes.any) return "-";
  const Duration lateness = extremes.worst_lateness;
  return lateness < 0 ? "-" + humanize_duration(-lateness) : humanize_duration(lateness);
}

std::string slack_text(const lab::Extremes &extremes) {
  return extremes.any ? fmt::format("{:.1f} %", std::floor(extremes.least_slack * 1000 + 1e-9) / 10) : "-";
}

std::string caps_text(const Workload &workload, std::span<const std::uint32_t> caps) {
  std::string text;
  for (std::size_t d = 0; d < caps.size(); ++d) {
    if (workload.dags[d].tasks.size() < 2 && caps[d] == 0) continue;
    text += fmt::format("{}{} {}", text.empty() ? "" : ", ", workload.dags[d].name, lab::bound_text(caps[d]));
  }
  return text.empty() ? "-" : text;
}

}  // namespace redag::cli
