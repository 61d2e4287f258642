// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/cli/top/live_table.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "redag/base/text.hpp"
#include "redag/live/rates.hpp"

namespace redag::cli {
namespace {

using live::Frame;
using live::page::Figures;

/// For example "9.52" or "1250"; "-" without jobs.
std::string rate_text(double rate) {
  if (rate <= 0) return "-";
  if (rate < 10) return fmt::format("{:.2f}", rate);
  return fmt::format("{:.{}f}", rate, rate < 1000 ? 1 : 0);
}

Cell time_cell(Duration time, Tint tint = Tint::Plain) {
  if (time <= 0) return {"-", Tint::Faint};
  return {humanize_duration(time), tint};
}

Cell count_cell(std::uint64_t count, Tint tint = Tint::Plain) {
  return {format_count(count), count > 0 ? tint : Tint::Faint};
}

/// All misses, and the recent ones: "23 +4".
Cell missed_cell(const Figures &figures) {
  Cell cell = count_cell(figures.misses, figures.recent_misses > 0 ? Tint::Bad : Tint::Caution);
  if (figures.recent_misses > 0) cell.text += " +" + format_count(figures.recent_misses);
  return cell;
}

Cell name_cell(const LiveRow &row, const LiveView &view) {
  const bool misses_now = row.figures().recent_misses > 0;
  if (row.task == nullptr) return {row.dag->name, misses_now ? Tint::Bad : Tint::Strong};
  const bool is_below_dag = view.order == LiveOrder::Dag && !view.all;
  return {is_below_dag ? "  " + row.task->name : row.name(), misses_now ? Tint::Bad : Tint::Plain};
}

/// Returns the cells of a row from its name on.
std::vector<Cell> cells_of(const LiveRow &row, const LiveView &view) {
  const Figures &figures = row.figures();
  const Duration deadline = row.task != nullptr ? row.task->deadline : row.dag->deadline;
  const Duration bound = row.task != nullptr ? row.task->bound : 0;
  const std::uint32_t cap = row.task != nullptr ? 0 : row.dag->max_active;
  const bool at_cap = cap > 0 && figures.active >= cap;
  const auto response_cell = [&](Duration time) { return time_cell(time, response_tint(time, deadline, bound)); };
  return {name_cell(row, view),
          {rate_text(rate_of(figures, row.frame()))},
          response_cell(figures.recent_p50),
          response_cell(figures.recent_p99),
          response_cell(figures.recent_max),
          response_cell(figures.response_max),
          time_cell(deadline),
          time_cell(bound),
          missed_cell(figures),
          {cap > 0 ? fmt::format("{}/{}", figures.active, cap) : fmt::format("{}", figures.active),
           figures.active == 0 ? Tint::Faint
           : at_cap            ? Tint::Caution
                               : Tint::Plain},
          count_cell(figures.away),
          count_cell(figures.ready, at_cap ? Tint::Caution : Tint::Plain),
          {format_percent(cpu_of(figures, row.frame()))}};
}

}  // namespace

std::string id_of(const live::Listed &listed) {
  return listed.number == 0 ? fmt::format("{}", listed.pid) : fmt::format("{}.{}", listed.pid, listed.number);
}

Table task_table(std::span<const live::Listed> pages, const LiveView &view) {
  std::vector<Column> columns{{"task", false, 99},  {"rate/s", true, 11}, {"p50", true, 7},       {"p99", true, 14},
                              {"max", true, 12},    {"worst", true, 8},   {"deadline", true, 10}, {"bound", true, 6},
                              {"missed", true, 13}, {"active", true, 5},  {"away", true, 3},      {"ready", true, 4},
                              {"cpu", true, 9}};
  const std::vector<Column> of_executor{
      {"level", true, 20}, {"period", true, 10}, {"pid", true, 5}, {"executor", false, 15}};
  if (view.all) columns.insert(columns.begin(), of_executor.begin(), of_executor.end());
  Table table(std::move(columns));
  for (const LiveRow &row : rows_of(pages, view)) {
    std::vector<Cell> cells = cells_of(row, view);
    if (view.all) {
      const int level = row.task->priority;
      const std::vector<Cell> executor{
          level > 0 ? Cell{fmt::format("{}", level), Tint::Strong} : Cell{"-", Tint::Faint},
          time_cell(row.task->period),
          {id_of(*row.executor)},
          {row.frame().name}};
      cells.insert(cells.begin(), executor.begin(), executor.end());
    }
    table.add(std::move(cells));
  }
  return table;
}

Table executor_table(const std::vector<live::Listed> &pages, Time now) {
  Table table({{"pid", true, 9},
               {"executor", false, 8},
               {"program", false, 6},
               {"driver", false, 4},
               {"tasks", true, 3},
               {"jobs", true, 2},
               {"missed", true, 5},
               {"up", true, 1},
               {"state", false, 7}});
  for (const live::Listed &listed : pages) {
    if (!listed.page) {
      table.add({{id_of(listed)}, {"?"}, {}, {}, {}, {}, {}, {}, {listed.page.error().front().message, Tint::Bad}});
      continue;
    }
    const Frame &frame = listed.page->frame;
    const Figures total = total_of(frame);
    const auto late = overdue(frame, now);
    table.add({{id_of(listed)},
               {frame.name},
               {frame.program},
               {frame.driver},
               {format_count(frame.tasks.size())},
               {format_count(total.released)},
               {format_count(total.misses), total.misses > 0 ? Tint::Bad : Tint::Faint},
               {humanize_duration(frame.published - frame.began)},
               late ? Cell{"no update for " + humanize_duration(*late), Tint::Bad} : Cell{"running", Tint::Good}});
  }
  return table;
}

}  // namespace redag::cli
