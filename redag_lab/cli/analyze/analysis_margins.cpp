// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/cli/analyze/analysis_margins.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "redag/base/text.hpp"
#include "redag_analysis/text/rounded_time.hpp"
#include "redag_analysis/text/table.hpp"

namespace redag::cli {
namespace {

using lab::Knob;
using lab::Margin;
using Kind = lab::Knob::Kind;

constexpr std::size_t kMostRows = 50;

// Formats a factor, rounded down so as not to overstate the margin.
std::string format_factor(double factor) {
  constexpr double kDigits = 1e4;
  return fmt::format("{:.4f}", std::floor(factor * kDigits + 1e-6) / kDigits);
}

// Returns the value of a knob that turns a single value; nothing for other knobs.
std::optional<Duration> value_at(const Knob &knob, std::optional<std::int64_t> position) {
  return knob.kind == Kind::Wcet ? position : std::nullopt;
}

// Formats the limit, rounded down.
std::string limit_text(const Margin &margin) {
  if (!margin.position) return "none";
  const std::optional<Duration> value = value_at(margin.knob, margin.position);
  return value ? humanize_down(*value) : "-";
}

// Returns all margins in order, or those with the least room. That of all tasks together is the first.
std::vector<Margin> shown_margins(std::vector<Margin> margins, bool all) {
  constexpr std::size_t kOfAllTasks = 1;
  if (all || margins.size() <= kMostRows) return margins;
  std::stable_sort(margins.begin() + kOfAllTasks, margins.end(),
                   [](const Margin &a, const Margin &b) { return a.factor < b.factor; });
  margins.resize(kMostRows);
  return margins;
}

}  // namespace

std::string knob_name(const lab::Analysed &analysed, const Knob &knob) {
  if (knob.kind == Kind::AllWcets) return "all wcets";
  return "wcet of " + task_name(analysed, TaskId(knob.tasks.front()));
}

std::string describe(const lab::Analysed &analysed, const std::vector<Margin> &margins, const StreamTraits &terminal,
                     bool all) {
  Table table({{"what", false, 9},
               {"now", true, 5},
               {"limit", true, 7},
               {"factor", true, 8},
               {.title = "limited by", .importance = 1, .prose = true}});
  const std::vector<Margin> shown = shown_margins(margins, all);
  for (const Margin &margin : shown) {
    const std::optional<Duration> now = value_at(margin.knob, margin.nominal);
    const Tint tint = !margin.position ? Tint::Bad : margin.factor < 1 ? Tint::Caution : Tint::Plain;
    table.add({{knob_name(analysed, margin.knob)},
               {now ? humanize_duration(*now) : "-"},
               {limit_text(margin)},
               {margin.position ? format_factor(margin.factor) : "none", tint},
               {margin.obstacle, Tint::Faint}});
  }
  std::string text = table.render(terminal.width, terminal.colour);
  if (shown.size() < margins.size()) {
    text += fmt::format("(the {} of {} that can grow least; --all-tasks shows all)\n", shown.size(),
                        format_count(margins.size()));
  }
  return text +
         "limit: the largest load at which every deadline is shown to be met; none: changing this alone does not "
         "suffice\n"
         "factor: load at the limit / present load, rounded down\n";
}

Json to_json(const lab::Analysed &analysed, const std::vector<Margin> &margins) {
  const auto value = [](const std::optional<Duration> &found) { return found ? Json(*found) : Json(); };
  Json rows = Json::array();
  for (const Margin &margin : margins) {
    rows.push_back(Json{{"name", knob_name(analysed, margin.knob)},
                        {"kind", margin.knob.kind == Kind::AllWcets ? "all_wcets" : "wcet"},
                        {"now_ns", value(value_at(margin.knob, margin.nominal))},
                        {"limit_ns", value(value_at(margin.knob, margin.position))},
                        {"factor", margin.position ? Json(margin.factor) : Json()},
                        {"obstacle", margin.obstacle}});
  }
  return rows;
}

}  // namespace redag::cli
