// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/loader/validate_parts.hpp"

#include <algorithm>
#include <string>
#include <unordered_map>
#include <utility>
#include <vector>

#include <fmt/format.h>

namespace redag {
namespace {

void report_duplicate_edges(const Dag &dag, const Task &task, FindingList &findings) {
  std::unordered_map<std::uint32_t, std::uint32_t> first;
  for (std::uint32_t k = 0; k < task.predecessors.size(); ++k) {
    const std::uint32_t p = task.predecessors[k];
    if (p >= dag.tasks.size() || first.emplace(p, k).second) continue;
    findings.error(Field::After, {},
                   fmt::format("task '{}' names predecessor '{}' twice", task.name, dag.tasks[p].name), "", k);
  }
}

// `cycle` runs against the edges: each task is a successor of the next one.
void report_cycle(const Dag &dag, DagId id, std::vector<std::uint32_t> cycle, FindingList &findings) {
  constexpr std::size_t kMostNamed = 12;
  std::reverse(cycle.begin(), cycle.end());
  std::rotate(cycle.begin(), std::min_element(cycle.begin(), cycle.end()), cycle.end());
  std::string names;
  for (std::size_t i = 0; i < cycle.size() && i < kMostNamed; ++i) names += dag.tasks[cycle[i]].name + " -> ";
  if (cycle.size() > kMostNamed) names += fmt::format("({} more) -> ", cycle.size() - kMostNamed);
  findings.at(id, cycle.front());
  findings.error(Field::After, {},
                 fmt::format("cycle in DAG '{}': {}{}", dag.name, names, dag.tasks[cycle.front()].name),
                 "remove one of these edges: a task cannot wait for itself");
}

// Depth-first search along predecessors, without recursion. An edge back to the current path closes a cycle. Reports
// each such edge, up to a bound that keeps the report readable.
bool check_cycles(const Dag &dag, DagId id, FindingList &findings) {
  enum class Mark : std::uint8_t { New, OnPath, Done };
  struct Step {
    std::uint32_t task;
    std::uint32_t next = 0;  // index in its predecessors
  };
  constexpr std::size_t kMostReported = 10;
  std::vector<Mark> marks(dag.tasks.size(), Mark::New);
  std::vector<Step> path;
  std::size_t cycles = 0;
  for (std::uint32_t root = 0; root < dag.tasks.size(); ++root) {
    if (marks[root] != Mark::New) continue;
    path.push_back({root});
    marks[root] = Mark::OnPath;
    while (!path.empty()) {
      Step &top = path.back();
      const auto &predecessors = dag.tasks[top.task].predecessors;
      if (top.next == predecessors.size()) {
        marks[top.task] = Mark::Done;
        path.pop_back();
        continue;
      }
      const std::uint32_t p = predecessors[top.next++];
      if (p >= dag.tasks.size() || p == top.task) continue;  // reported as edges
      if (marks[p] == Mark::OnPath && cycles++ < kMostReported) {
        auto start = std::find_if(path.begin(), path.end(), [p](const Step &step) { return step.task == p; });
        std::vector<std::uint32_t> cycle;
        for (; start != path.end(); ++start) cycle.push_back(start->task);
        report_cycle(dag, id, std::move(cycle), findings);
      } else if (marks[p] == Mark::New) {
        marks[p] = Mark::OnPath;
        path.push_back({p});
      }
    }
  }
  return cycles == 0;
}

// Requires an acyclic DAG without unsound edges; other DAGs have no periods to inherit.
void check_inherited_periods(const Dag &dag, DagId id, FindingList &findings) {
  for (std::uint32_t i = 0; i < dag.tasks.size(); ++i) {
    const Task &task = dag.tasks[i];
    if (task.activation != Activation::Data) continue;
    Duration largest = 0;
    for (const std::uint32_t p : task.predecessors) largest = std::max(largest, dag.tasks[p].period);
    if (task.period == largest) continue;
    findings.at(id, i);
    findings.error(Field::Period, Field::After,
                   fmt::format("period {} of data task '{}' is not {}, the largest period of its predecessors",
                               format_duration(task.period), task.name, format_duration(largest)),
                   "call inherit_periods() after changes of periods");
  }
}

}  // namespace

bool check_edges(const Dag &dag, std::uint32_t index, FindingList &findings) {
  const Task &task = dag.tasks[index];
  bool sound = task.activation == Activation::Timer || !task.predecessors.empty();
  std::vector<std::uint32_t> seen;
  for (std::uint32_t k = 0; k < task.predecessors.size(); ++k) {
    const std::uint32_t p = task.predecessors[k];
    std::string message;
    if (p >= dag.tasks.size()) {
      message = fmt::format("predecessor {} of task '{}' does not exist", p, task.name);
    } else if (p == index) {
      message = fmt::format("task '{}' is its own predecessor", task.name);
    }
    if (message.empty()) {
      seen.push_back(p);
      continue;
    }
    sound = false;
    findings.error(Field::After, {}, std::move(message), "", k);
  }
  std::sort(seen.begin(), seen.end());
  if (std::adjacent_find(seen.begin(), seen.end()) == seen.end()) return sound;
  report_duplicate_edges(dag, task, findings);
  return false;
}

void check_graph(const Dag &dag, DagId id, bool sound_edges, FindingList &findings) {
  const bool acyclic = check_cycles(dag, id, findings);
  if (sound_edges && acyclic) check_inherited_periods(dag, id, findings);
  findings.at(id);
}

}  // namespace redag
