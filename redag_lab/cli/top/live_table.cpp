// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/cli/top/live_table.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <numeric>

#include "redag/base/text.hpp"
#include "redag_analysis/text/table.hpp"
#include "redag_lab/cli/top/live_cells.hpp"

namespace redag::cli {
namespace {

using live::Frame;
using live::page::Figures;

constexpr std::size_t kGap = 2;
constexpr std::size_t kLeastName = 12;  // a name is not cut below this
constexpr std::size_t kLeastGraph = 6;
constexpr std::size_t kMostGraph = 30;

enum class Field : std::uint8_t {
  Name,
  Rate,
  P50,
  P99,
  Longest,
  Deadline,
  Bound,
  Missed,
  Active,
  Away,
  Ready,
  Waiting,
  Preempted,
  Cpu,
  Histogram,
  Course,
};

struct Column {
  Field field;
  const char *title;
  unsigned importance;  // columns of lower importance are left out first
  std::optional<LiveOrder> order;
};

// From left to right. The graphs at the end share what room is left.
constexpr Column kColumns[] = {
    {Field::Name, "task", 99, LiveOrder::Name},
    {Field::Rate, "rate/s", 11, LiveOrder::Rate},
    {Field::P50, "p50", 7, std::nullopt},
    {Field::P99, "p99", 14, LiveOrder::P99},
    {Field::Longest, "max", 12, LiveOrder::Longest},
    {Field::Deadline, "deadline", 10, std::nullopt},
    {Field::Bound, "bound", 6, std::nullopt},
    {Field::Missed, "missed", 13, LiveOrder::Misses},
    {Field::Active, "active", 5, std::nullopt},
    {Field::Away, "away", 3, std::nullopt},
    {Field::Ready, "ready", 4, std::nullopt},
    {Field::Waiting, "wait", 1, std::nullopt},
    {Field::Preempted, "preempted", 2, std::nullopt},
    {Field::Cpu, "cpu", 9, LiveOrder::Cpu},
    {Field::Histogram, "times", 8, std::nullopt},
    {Field::Course, "p99 lately", 0, std::nullopt},
};
constexpr std::size_t kCount = std::size(kColumns);

bool is_graph(std::size_t column) { return kColumns[column].field >= Field::Histogram; }

/// What a row shows, of a DAG or of a task.
struct Shown {
  const Figures &figures;
  Duration deadline;
  Duration bound;
  std::uint32_t cap;  // most active jobs; 0: no bound
  const live::page::Spread &spread;
};

Shown shown_of(const LiveRow &row, const Frame &frame) {
  if (!row.is_dag) {
    const live::TaskFrame &task = frame.tasks[row.index];
    return {task.figures, task.deadline, task.bound, 0, task.spread};
  }
  const live::DagFrame &dag = frame.dags[row.index];
  return {dag.figures, dag.deadline, 0, dag.max_active, dag.spread};
}

Cell name_cell(const LiveRow &row, const Frame &frame, const LiveView &view) {
  const bool misses_now = shown_of(row, frame).figures.recent_misses > 0;
  if (row.is_dag) return {frame.dags[row.index].name, misses_now ? Tint::Bad : Tint::Strong};
  const bool is_below_dag = view.order == LiveOrder::Dag;
  const live::TaskFrame &task = frame.tasks[row.index];
  return {is_below_dag ? "  " + task.name : full_name(task, frame), misses_now ? Tint::Bad : Tint::Plain};
}

Cell cell_of(Field field, const LiveRow &row, const Frame &frame, const LiveView &view) {
  const Shown shown = shown_of(row, frame);
  const Figures &figures = shown.figures;
  const LiveResponse response = response_of(figures, view.since_start);
  const auto response_cell = [&](Duration time) {
    return time_cell(time, response_tint(time, shown.deadline, shown.bound));
  };
  const bool at_cap = shown.cap > 0 && figures.active >= shown.cap;
  switch (field) {
    case Field::Name: return name_cell(row, frame, view);
    case Field::Rate: return {rate_text(rate_of(figures, frame, view.since_start))};
    case Field::P50: return response_cell(response.p50);
    case Field::P99: return response_cell(response.p99);
    case Field::Longest: return response_cell(response.longest);
    case Field::Deadline: return time_cell(shown.deadline);
    case Field::Bound: return time_cell(shown.bound);
    case Field::Missed: return missed_cell(shown.figures);
    case Field::Active: {
      const std::string active =
          shown.cap > 0 ? fmt::format("{}/{}", figures.active, shown.cap) : fmt::format("{}", figures.active);
      return {active, figures.active == 0 ? Tint::Faint : at_cap ? Tint::Caution : Tint::Plain};
    }
    case Field::Away: return count_cell(figures.away);
    case Field::Ready: return count_cell(figures.ready, figures.ready > 0 && at_cap ? Tint::Caution : Tint::Plain);
    case Field::Waiting: return count_cell(figures.waiting);
    case Field::Preempted: return count_cell(view.since_start ? figures.preemptions : figures.recent_preemptions);
    case Field::Cpu: return {format_percent(cpu_of(figures, frame, view.since_start))};
    case Field::Histogram:
    case Field::Course: break;
  }
  return {};
}

/// The columns that are shown, with their widths.
struct Layout {
  std::vector<std::size_t> widths = std::vector<std::size_t>(kCount);
  std::vector<bool> shown = std::vector<bool>(kCount);
};

// Gives columns their room in the order of importance, to graphs the least that they need.
Layout lay_out(const std::vector<std::vector<Cell>> &cells, std::size_t width, bool with_course) {
  Layout layout;
  for (std::size_t i = 0; i < kCount; ++i) {
    layout.widths[i] = display_width(kColumns[i].title);
    for (const std::vector<Cell> &row : cells)
      layout.widths[i] = std::max(layout.widths[i], display_width(row[i].text));
  }
  if (width == 0) {
    layout.shown.assign(kCount, true);
    layout.widths[kCount - 2] = layout.widths[kCount - 1] = kMostGraph / 2;
    layout.shown[kCount - 1] = with_course;
    return layout;
  }
  std::vector<std::size_t> order(kCount);
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::sort(order.begin(), order.end(),
            [](std::size_t a, std::size_t b) { return kColumns[a].importance > kColumns[b].importance; });
  // The names leave room for the two most important figures, unless they would be cut too short.
  const std::size_t figures = 2 * kGap + layout.widths[order[1]] + layout.widths[order[2]];
  std::size_t &name = layout.widths[0];
  name = std::min(name, std::max(width > figures ? width - figures : 0, std::min(kLeastName, width)));
  std::size_t left = width;
  for (const std::size_t i : order) {
    if (kColumns[i].field == Field::Course && !with_course) continue;
    if (is_graph(i)) layout.widths[i] = kLeastGraph;
    const std::size_t needed = layout.widths[i] + (i == 0 ? 0 : kGap);
    layout.shown[i] = needed <= left;
    if (layout.shown[i]) left -= needed;
  }
  // Graphs share what is left.
  for (std::size_t i = kCount - 2; i < kCount; ++i) {
    if (!layout.shown[i]) continue;
    const bool shares = i + 1 < kCount && layout.shown[i + 1];
    const std::size_t more = std::min(shares ? left / 2 : left, kMostGraph - kLeastGraph);
    layout.widths[i] += more;
    left -= more;
  }
  return layout;
}

std::string title_of(std::size_t column, std::size_t width, const TimeAxis &axis, const LiveView &view) {
  if (kColumns[column].field == Field::Histogram && !axis.is_empty()) return axis_text(axis, width);
  if (column == 0 && view.dags_only) return "DAG";
  return kColumns[column].title;
}

}  // namespace

LiveTable make_table(const Frame &frame, const LiveView &view, const Course *course, std::size_t width,
                     const Glyphs &glyphs) {
  LiveTable table;
  table.rows = rows_of(frame, view);
  std::vector<std::vector<Cell>> cells;
  for (const LiveRow &row : table.rows) {
    std::vector<Cell> &of_row = cells.emplace_back();
    for (const Column &column : kColumns) of_row.push_back(cell_of(column.field, row, frame, view));
  }
  const Layout layout = lay_out(cells, width, course != nullptr);
  const TimeAxis axis = axis_of(frame);

  std::size_t at = 0;
  for (std::size_t i = 0; i < kCount; ++i) {
    if (!layout.shown[i]) {
      if (i + 1 < kCount || course != nullptr) table.hidden.emplace_back(kColumns[i].title);
      continue;
    }
    const bool is_sorted = kColumns[i].order == view.order && !(view.order == LiveOrder::Dag);
    const std::size_t gap = at > 0 ? kGap : 0;
    if (gap > 0) table.titles.push_back({std::string(gap, ' '), Tint::Strong});
    const std::string title = title_of(i, layout.widths[i], axis, view);
    table.titles.push_back({padded(title, layout.widths[i], i > 0 && !is_graph(i)), Tint::Strong, is_sorted});
    table.places.push_back({at, at + gap + layout.widths[i], kColumns[i].order});
    at += gap + layout.widths[i];
  }
  for (std::size_t r = 0; r < table.rows.size(); ++r) {
    const LiveRow &row = table.rows[r];
    const Shown shown = shown_of(row, frame);
    Line line;
    for (std::size_t i = 0; i < kCount; ++i) {
      if (!layout.shown[i]) continue;
      if (!line.empty()) line.push_back({std::string(kGap, ' ')});
      Line graph;
      if (kColumns[i].field == Field::Histogram) {
        graph = histogram(view.since_start ? shown.spread.all : shown.spread.recent, axis, shown.deadline,
                          layout.widths[i], glyphs);
      } else if (kColumns[i].field == Field::Course) {
        graph = course->graph(full_name(row, frame), shown.deadline, layout.widths[i], glyphs);
      } else {
        const Cell &cell = cells[r][i];
        const std::string text = i == 0 ? cut_middle(cell.text, layout.widths[i]) : cell.text;
        graph = {{padded(text, layout.widths[i], i > 0), cell.tint}};
      }
      line.insert(line.end(), graph.begin(), graph.end());
    }
    table.lines.push_back(std::move(line));
  }
  return table;
}

}  // namespace redag::cli
