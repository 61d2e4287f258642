// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/cli/experiment/experiment_report.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <tuple>

#include "redag/base/text.hpp"
#include "redag_analysis/text/table.hpp"

namespace redag::cli {
namespace {

using experiment::AcceptanceCell;
using experiment::AcceptancePlan;
using experiment::AcceptancePoint;
using experiment::AcceptanceRow;

auto panel_of(const AcceptancePoint &point) {
  return std::tuple(point.dags, point.workers, point.deadlines, point.preemption);
}

std::string heading(const AcceptancePoint &point) {
  return fmt::format("{} DAGs, {} workers, {} deadlines, preemption {}", point.dags, point.workers,
                     to_string(point.deadlines), to_string(point.preemption));
}

Cell cell_of(const AcceptanceRow &row, const AcceptanceCell &cell) {
  if (row.sets == 0 || cell.not_applicable == row.sets) return {"-", Tint::Faint};
  const std::string share = format_percent(static_cast<double>(cell.accepted) / static_cast<double>(row.sets));
  return {share + (cell.unsound > 0 ? "!" : ""), cell.unsound > 0 ? Tint::Caution : Tint::Plain};
}

Table table_for(const AcceptancePlan &plan) {
  std::vector<Column> columns = {{"utilization", true, 1000}, {"sets", true, 0}};
  for (std::size_t m = 0; m < plan.methods.size(); ++m) {
    columns.push_back({plan.methods[m], true, static_cast<unsigned>(500 - std::min<std::size_t>(m, 499))});
  }
  return Table(std::move(columns));
}

}  // namespace

std::string describe(const experiment::Acceptance &acceptance, const experiment::AcceptanceResults &results,
                     const StreamTraits &traits) {
  std::string text;
  bool unsound = false;
  for (auto row = results.rows.begin(); row != results.rows.end();) {
    text += (text.empty() ? "" : "\n") + tinted(heading(row->point), Tint::Strong, traits.colour) + "\n";
    Table table = table_for(acceptance.plan());
    const auto panel = panel_of(row->point);
    for (; row != results.rows.end() && panel_of(row->point) == panel; ++row) {
      std::vector<Cell> cells = {
          {fmt::format("{}", row->point.utilization / static_cast<double>(experiment::kMillion))},
          {format_count(row->sets)}};
      for (const AcceptanceCell &cell : row->cells) {
        cells.push_back(cell_of(*row, cell));
        unsound = unsound || cell.unsound > 0;
      }
      table.add(std::move(cells));
    }
    text += table.render(traits.width, traits.colour);
  }
  if (unsound) text += "\n!: accepted by an equation whose assumptions do not hold here: no proof\n";
  if (!results.complete()) {
    text += fmt::format(
        "\n"
        "{} of {} workloads are done\n",
        format_count(results.done), format_count(results.units));
  }
  return text;
}

}  // namespace redag::cli
