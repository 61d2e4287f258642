// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/cli/top/live_cells.hpp"

#include <fmt/format.h>

#include "redag/base/text.hpp"

namespace redag::cli {

std::string rate_text(double rate) {
  if (rate <= 0) return "-";
  if (rate < 10) return fmt::format("{:.2f}", rate);
  return fmt::format("{:.{}f}", rate, rate < 1000 ? 1 : 0);
}

Cell time_cell(Duration time, Tint tint) {
  if (time <= 0) return {"-", Tint::Faint};
  return {humanize_duration(time), tint};
}

Cell count_cell(std::uint64_t count, Tint tint) { return {format_count(count), count > 0 ? tint : Tint::Faint}; }

Cell missed_cell(const live::page::Figures &figures) {
  Cell cell = count_cell(figures.misses, figures.recent_misses > 0 ? Tint::Bad : Tint::Caution);
  if (figures.recent_misses > 0) cell.text += " +" + format_count(figures.recent_misses);
  return cell;
}

}  // namespace redag::cli
