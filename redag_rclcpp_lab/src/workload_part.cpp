// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "workload_part.hpp"

#include <fmt/format.h>

#include <cctype>
#include <map>

namespace redag_rclcpp::lab {

redag::Result<void> check_parts(const redag::Workload &workload) {
  std::map<std::string, std::size_t> owners;
  for (std::size_t dag = 0; dag < workload.dags.size(); ++dag) {
    for (const redag::Task &task : workload.dags[dag].tasks) {
      if (task.group.empty()) continue;
      const auto owner = owners.emplace(task.group, dag).first;
      if (owner->second == dag) continue;
      return redag::make_error(
          fmt::format("the group '{}' has tasks of the DAGs '{}' and '{}', which processes of their own cannot exclude",
                      task.group, workload.dags[owner->second].name, workload.dags[dag].name),
          "run the executors without '-split', or give each DAG groups of its own");
    }
  }
  return {};
}

WorkloadPart part_of(const redag::Workload &workload, std::size_t dag) {
  WorkloadPart part{workload, 0};
  for (std::size_t i = 0; i < dag; ++i) part.first_task += static_cast<std::uint32_t>(workload.dags[i].tasks.size());
  part.workload.dags = {workload.dags.at(dag)};
  return part;
}

std::string folder_of_part(const redag::Workload &workload, std::size_t dag) {
  std::string name = fmt::format("{}-", dag + 1);
  for (const char c : workload.dags.at(dag).name) {
    name += std::isalnum(static_cast<unsigned char>(c)) != 0 ? c : '_';
  }
  return name;
}

}  // namespace redag_rclcpp::lab
