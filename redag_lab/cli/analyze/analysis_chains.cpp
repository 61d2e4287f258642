// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/cli/analyze/analysis_chains.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "redag_analysis/text/table.hpp"
#include "redag_lab/cli/analyze/analysis_explanation.hpp"

namespace redag::cli {
namespace {

using analysis::ChainBound;
using analysis::ChainSegment;
using analysis::NotApplicable;

Result<TaskId> find_task(const lab::Analysed &analysed, const std::string &name) {
  const Result<lab::Row> row = find_row(analysed, name);
  if (!row) return tl::unexpected<Diagnostics>(row.error());
  for (std::size_t t = 0; t < analysed.task_set.tasks.size(); ++t) {
    if (task_name(analysed, TaskId(t)) == row->name) return TaskId(t);
  }
  return make_error("'" + name + "' is a DAG", "a chain consists of tasks: write dag.task,dag.task");
}

std::optional<Duration> let_reaction_of(const lab::Analysed &analysed, const std::vector<TaskId> &tasks) {
  std::vector<analysis::LetTask> chain;
  for (const TaskId id : tasks) {
    const analysis::CompiledTask &task = analysed.task_set.tasks[id.value];
    const analysis::CompiledTask &first = analysed.task_set.tasks[tasks.front().value];
    if (task.data || task.has_gaps || task.clock != first.clock) return std::nullopt;
    chain.push_back({task.period, task.offset, task.deadline});
  }
  return analysis::let_reaction(chain);
}

std::string name_of(const lab::Analysed &analysed, const std::vector<TaskId> &tasks) {
  std::string text;
  for (const TaskId task : tasks) text += (text.empty() ? "" : " > ") + task_name(analysed, task);
  return text;
}

std::string name_of(const lab::Analysed &analysed, const ChainSegment &segment) {
  std::string text = task_name(analysed, segment.first);
  if (segment.last != segment.first) text += " to " + task_name(analysed, segment.last);
  return text;
}

}  // namespace

std::vector<std::string> names_in(const std::string &chain) {
  std::vector<std::string> names;
  for (std::size_t begin = 0; begin <= chain.size();) {
    const std::size_t end = std::min(chain.find(',', begin), chain.size());
    names.push_back(chain.substr(begin, end - begin));
    begin = end + 1;
  }
  return names;
}

Result<ChainRow> find_chain(const lab::Analysed &analysed, const std::string &chain) {
  ChainRow row;
  for (const std::string &name : names_in(chain)) {
    const Result<TaskId> task = find_task(analysed, name);
    if (!task) return tl::unexpected<Diagnostics>(task.error());
    row.tasks.push_back(*task);
  }
  row.bound = analysis::chain_bound(analysed.task_set, row.tasks, analysis::tightest_of(analysed.report));
  row.let = let_reaction_of(analysed, row.tasks);
  return row;
}

std::string describe(const lab::Analysed &analysed, const std::vector<ChainRow> &chains, const StreamTraits &terminal) {
  Table table(
      {{.title = "chain", .importance = 9, .prose = true}, {"reaction", true, 8}, {"age", true, 7}, {"LET", true, 5}});
  std::string parts;
  for (const ChainRow &row : chains) {
    const std::string let = row.let ? humanize_duration(*row.let) : "-";
    const std::string name = name_of(analysed, row.tasks);
    const auto *bound = std::get_if<ChainBound>(&row.bound);
    if (bound == nullptr) {
      table.add({{name}, {"-"}, {"-"}, {let}});
      parts += fmt::format("{}: no bound: {}\n", name, std::get<NotApplicable>(row.bound).reason);
      continue;
    }
    table.add({{name}, {humanize_duration(bound->reaction())}, {humanize_duration(bound->age())}, {let}});
    for (const ChainSegment &segment : bound->segments) {
      parts += fmt::format("  {} adds {}: period {}, response {}\n", name_of(analysed, segment),
                           humanize_duration(segment.hop), humanize_duration(segment.period),
                           humanize_duration(segment.response));
    }
  }
  return table.render(terminal.width, terminal.colour) + parts +
         "reaction: largest time from an input to an output that depends on it\n"
         "age: largest age of the input behind an output, until the next output\nBoth assume strictly periodic timers. "
         "LET: both, exactly, if tasks read at their release and write at their deadline\n";
}

Json to_json(const lab::Analysed &analysed, const std::vector<ChainRow> &chains) {
  Json document = Json::array();
  for (const ChainRow &row : chains) {
    const auto *bound = std::get_if<ChainBound>(&row.bound);
    Json tasks = Json::array();
    for (const TaskId task : row.tasks) tasks.push_back(task_name(analysed, task));
    Json segments = Json::array();
    if (bound != nullptr) {
      for (const ChainSegment &segment : bound->segments) {
        segments.push_back(Json{{"first", task_name(analysed, segment.first)},
                                {"last", task_name(analysed, segment.last)},
                                {"period_ns", segment.period},
                                {"response_ns", segment.response},
                                {"adds_ns", segment.hop}});
      }
    }
    document.push_back(Json{{"tasks", std::move(tasks)},
                            {"reaction_ns", bound != nullptr ? Json(bound->reaction()) : Json()},
                            {"age_ns", bound != nullptr ? Json(bound->age()) : Json()},
                            {"let_ns", row.let ? Json(*row.let) : Json()},
                            {"reason", bound != nullptr ? "" : std::get<NotApplicable>(row.bound).reason},
                            {"segments", std::move(segments)}});
  }
  return document;
}

}  // namespace redag::cli
