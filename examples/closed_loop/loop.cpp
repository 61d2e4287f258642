// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "loop.hpp"

#include <algorithm>
#include <stdexcept>

namespace closed_loop {

Loops::Loops(const std::vector<PlantSpec> &plants, std::uint64_t seed) : plants_(plants) {
  for (std::size_t i = 0; i < plants.size(); ++i) {
    loops_.push_back(std::make_unique<Loop>(plants[i], seed * 1000 + i));
  }
}

std::vector<TaskRole> Loops::roles(const redag::Workload &workload) const {
  std::vector<TaskRole> roles(workload.task_count());
  for (std::size_t i = 0; i < plants_.size(); ++i) {
    bool senses = false;
    bool controls = false;
    for (const redag::TaskRef &ref : redag::flatten(workload)) {
      if (workload.dags[ref.dag.value].name != plants_[i].name) continue;
      if (ref.task->name == "sense") roles[ref.id.value] = {Role::Sense, loops_[i].get()};
      if (ref.task->name == "control") roles[ref.id.value] = {Role::Control, loops_[i].get()};
      senses = senses || ref.task->name == "sense";
      controls = controls || ref.task->name == "control";
    }
    if (!senses || !controls) {
      throw std::runtime_error("the workload has no DAG '" + plants_[i].name + "' with tasks 'sense' and 'control'");
    }
  }
  return roles;
}

}  // namespace closed_loop
