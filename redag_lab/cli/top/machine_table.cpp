// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/cli/top/machine_table.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <tuple>

#include "redag/base/text.hpp"
#include "redag_analysis/text/table.hpp"
#include "redag_lab/cli/top/live_cells.hpp"

namespace redag::cli {

using live::Frame;
using live::TaskFrame;

std::vector<MachineRow> machine_rows(const std::vector<live::Listed> &pages, const LiveView &view) {
  std::vector<MachineRow> rows;
  for (std::size_t p = 0; p < pages.size(); ++p) {
    if (!pages[p].page) continue;
    const Frame &frame = pages[p].page->frame;
    for (std::size_t t = 0; t < frame.tasks.size(); ++t) {
      const bool is_shown =
          contains(full_name(frame.tasks[t], frame), view.filter) || contains(frame.name, view.filter);
      if (is_shown) rows.push_back({p, t});
    }
  }
  const auto key = [&](const MachineRow &row) {
    const TaskFrame &task = pages[row.page].page->frame.tasks[row.task];
    return std::tuple(-task.priority, task.period);
  };
  std::stable_sort(rows.begin(), rows.end(), [&](const MachineRow &a, const MachineRow &b) { return key(a) < key(b); });
  if (view.reversed) std::reverse(rows.begin(), rows.end());
  return rows;
}

std::string machine_text(const std::vector<live::Listed> &pages, const LiveView &view, std::size_t width, bool colour) {
  Table table({{"level", true, 10},
               {"pid", true, 7},
               {"executor", false, 6},
               {"task", false, 12},
               {"period", true, 9},
               {"rate/s", true, 3},
               {"p50", true, 1},
               {"p99", true, 8},
               {"max", true, 5},
               {"deadline", true, 2},
               {"missed", true, 11},
               {"cpu", true, 4}});
  for (const MachineRow &row : machine_rows(pages, view)) {
    const live::Listed &listed = pages[row.page];
    const Frame &frame = listed.page->frame;
    const TaskFrame &task = frame.tasks[row.task];
    const LiveResponse response = response_of(task.figures, view.since_start);
    const auto response_cell = [&](Duration time) {
      return time_cell(time, response_tint(time, task.deadline, task.bound));
    };
    table.add({task.priority > 0 ? Cell{fmt::format("{}", task.priority), Tint::Strong} : Cell{"-", Tint::Faint},
               {listed.number == 0 ? fmt::format("{}", listed.pid) : fmt::format("{}.{}", listed.pid, listed.number)},
               {frame.name},
               {full_name(task, frame)},
               time_cell(task.period),
               {rate_text(rate_of(task.figures, frame, view.since_start))},
               response_cell(response.p50),
               response_cell(response.p99),
               response_cell(response.longest),
               time_cell(task.deadline),
               missed_cell(task.figures),
               {format_percent(cpu_of(task.figures, frame, view.since_start))}});
  }
  return table.render(width, colour);
}

}  // namespace redag::cli
