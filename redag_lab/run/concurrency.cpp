// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/run/concurrency.hpp"

#include <algorithm>
#include <set>
#include <string_view>

namespace redag::lab {

std::uint64_t most_started(const Workload &workload) {
  std::set<std::string_view> all_groups;
  std::uint64_t ungrouped = 0;
  std::uint64_t by_dag = 0;
  for (const Dag &dag : workload.dags) {
    std::set<std::string_view> groups;
    std::uint64_t jobs = 0;
    for (const Task &task : dag.tasks) {
      if (task.group.empty()) {
        jobs += task.concurrency;
      } else {
        groups.insert(task.group);
      }
    }
    ungrouped += jobs;
    jobs += groups.size();
    all_groups.merge(groups);
    by_dag += dag.max_active > 0 ? std::min<std::uint64_t>(jobs, dag.max_active) : jobs;
  }
  return std::min(by_dag, ungrouped + all_groups.size());
}

}  // namespace redag::lab
