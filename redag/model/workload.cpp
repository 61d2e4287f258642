// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/model/workload.hpp"

#include <algorithm>
#include <functional>
#include <numeric>
#include <queue>

#include "redag/base/check.hpp"

namespace redag {

std::size_t Workload::task_count() const {
  std::size_t count = 0;
  for (const Dag &dag : dags) count += dag.tasks.size();
  return count;
}

double Workload::utilization() const {
  double sum = 0;
  for (const Dag &dag : dags) sum += dag.utilization();
  return sum;
}

double Dag::utilization() const {
  double sum = 0;
  for (const Task &task : tasks) {
    if (task.period > 0) sum += static_cast<double>(task.wcet) / static_cast<double>(task.period);
  }
  return sum;
}

std::vector<TaskRef> flatten(const Workload &workload) {
  std::vector<TaskRef> refs;
  refs.reserve(workload.task_count());
  for (std::size_t d = 0; d < workload.dags.size(); ++d) {
    const auto &tasks = workload.dags[d].tasks;
    for (std::size_t i = 0; i < tasks.size(); ++i) {
      refs.push_back(TaskRef{DagId(d), static_cast<std::uint32_t>(i), &tasks[i], TaskId(refs.size())});
    }
  }
  return refs;
}

std::vector<std::uint32_t> topological_ranks(const Dag &dag) {
  const std::size_t count = dag.tasks.size();
  std::vector<std::uint32_t> missing(count);
  std::vector<std::uint32_t> first(count + 1);  // successors of i: [first[i], first[i + 1])
  std::priority_queue<std::uint32_t, std::vector<std::uint32_t>, std::greater<>> open;
  for (std::uint32_t i = 0; i < count; ++i) {
    missing[i] = static_cast<std::uint32_t>(dag.tasks[i].predecessors.size());
    for (const std::uint32_t p : dag.tasks[i].predecessors) ++first[p + 1];
    if (missing[i] == 0) open.push(i);
  }
  std::partial_sum(first.begin(), first.end(), first.begin());
  std::vector<std::uint32_t> successors(first.back());
  std::vector<std::uint32_t> last(first.begin(), first.end() - 1);
  for (std::uint32_t i = 0; i < count; ++i) {
    for (const std::uint32_t p : dag.tasks[i].predecessors) successors[last[p]++] = i;
  }
  std::vector<std::uint32_t> ranks(count);
  std::uint32_t next = 0;
  while (!open.empty()) {
    const std::uint32_t i = open.top();
    open.pop();
    ranks[i] = next++;
    for (std::uint32_t s = first[i]; s < first[i + 1]; ++s) {
      if (--missing[successors[s]] == 0) open.push(successors[s]);
    }
  }
  REDAG_CHECK(next == count, "a DAG must be acyclic");
  return ranks;
}

void inherit_periods(Dag &dag) {
  const std::vector<std::uint32_t> ranks = topological_ranks(dag);
  std::vector<std::uint32_t> order(ranks.size());
  for (std::uint32_t i = 0; i < ranks.size(); ++i) order[ranks[i]] = i;
  for (const std::uint32_t i : order) {
    Task &task = dag.tasks[i];
    if (task.activation == Activation::Data) {
      Duration largest = 0;
      for (const std::uint32_t p : task.predecessors) largest = std::max(largest, dag.tasks[p].period);
      task.period = largest;
    }
    if (task.deadline == 0) task.deadline = task.period;
  }
}

}  // namespace redag
