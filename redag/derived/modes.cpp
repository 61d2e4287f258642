// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/derived/modes.hpp"

#include <algorithm>

#include <fmt/format.h>

#include "redag/derived/clusters.hpp"

namespace redag {

std::set<std::uint32_t> executors_with_modes(const Workload &workload) {
  std::set<std::uint32_t> executors;
  for (const Dag &dag : workload.dags) {
    const bool begins_one = std::any_of(dag.tasks.begin(), dag.tasks.end(), [](const Task &task) {
      return task.wcet_low > 0 && task.wcet_low < task.wcet;
    });
    if (begins_one) executors.insert(dag.executor);
  }
  return executors;
}

bool has_separate_modes(const Workload &workload) {
  const bool is_alone = std::all_of(workload.dags.begin(), workload.dags.end(),
                                    [&](const Dag &dag) { return dag.executor == workload.dags.front().executor; });
  return !is_alone && !executors_with_modes(workload).empty();
}

Result<void> refuse_separate_modes(const Workload &workload, std::string_view who) {
  for (const ClusterPart &part : parts_of(workload)) {
    if (!has_separate_modes(part.workload)) continue;
    return make_error(fmt::format("{} knows one HI mode, but here each process has its own, and HI mode of one stops "
                                  "no work of the others",
                                  who),
                      "remove 'wcet_low:' from the tasks, or use 'redag analyze', which bounds each process");
  }
  return {};
}

}  // namespace redag
