// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "tests/testing/exploration/exploration_model.hpp"

#include <algorithm>
#include <numeric>

#include "redag/base/rng.hpp"
#include "redag_analysis/core/arithmetic.hpp"

namespace redag::analysis {
namespace {

// A unit is released as a whole, with the offset of its timers.
Time offset_of(const TaskSet &task_set, const Unit &unit) {
  for (const std::uint32_t t : unit.tasks) {
    if (!task_set.tasks[t].data) return task_set.tasks[t].offset;
  }
  return 0;
}

std::uint32_t workers_of(const TaskSet &task_set) {
  const AnalysisPlatform &platform = task_set.platform;
  return platform.max_started > 0 ? std::min(platform.workers, platform.max_started) : platform.workers;
}

class Builder {
 public:
  Builder(const TaskSet &task_set, std::uint64_t max_jobs) : task_set_(task_set), max_jobs_(max_jobs) {}

  ExplorationModel run() {
    model_.workers = workers_of(task_set_);
    model_.hyperperiod = hyperperiod_of(task_set_);
    model_.tasks.resize(task_set_.tasks.size());
    for (const Unit &unit : task_set_.units) {
      for (const std::uint32_t t : unit.tasks) add_task(unit, t);
    }
    layout();
    return std::move(model_);
  }

 private:
  void add_task(const Unit &unit, std::uint32_t t) {
    const CompiledTask &task = task_set_.tasks[t];
    ExploredTask &added = model_.tasks[t];
    added.offset = offset_of(task_set_, unit);
    added.period = unit.period;
    added.bcet = task.bcet;
    added.wcet = task.wcet;
    added.jitter = task.data ? 0 : task.jitter;
    added.deadline = task.deadline;
    added.predecessors = task.predecessors;
    added.successors = task.successors;
    added.hash = mix(t) | 1;
    const Duration jobs = model_.hyperperiod / unit.period;
    model_.jobs += static_cast<std::uint64_t>(jobs);
    if (model_.jobs > max_jobs_) return;
    added.jobs = static_cast<std::uint32_t>(jobs);
    model_.round_hash += added.hash * added.jobs;
  }

  // Assigns the places of a state. With one worker, a free worker means that all gates are free and that all dispatched
  // jobs have ended: the worker's interval is the whole state.
  void layout() {
    model_.width = model_.workers;
    if (model_.workers == 1) return;
    std::vector<Gate> groups(task_set_.groups.size());
    for (const CompiledDag &dag : task_set_.dags) {
      if (dag.max_active == 0 || dag.max_active >= model_.workers) continue;
      const Gate gate = new_gate(dag.max_active);
      for (const std::uint32_t t : dag.tasks) model_.tasks[t].gates.push_back(gate);
    }
    for (const std::vector<std::uint32_t> &group : task_set_.groups) {
      if (group.empty()) continue;
      const Gate gate = new_gate(1);
      for (const std::uint32_t t : group) model_.tasks[t].gates.push_back(gate);
    }
    for (ExploredTask &task : model_.tasks) {
      if (!task.successors.empty()) task.finish = model_.width++;
    }
  }

  Gate new_gate(std::uint32_t places) {
    const Gate gate{model_.width, places};
    model_.width += places;
    return gate;
  }

  const TaskSet &task_set_;
  std::uint64_t max_jobs_;
  ExplorationModel model_;
};

}  // namespace

Duration hyperperiod_of(const TaskSet &task_set) {
  Int128 result = 1;
  for (const Unit &unit : task_set.units) {
    result = result / std::gcd(static_cast<Duration>(result), unit.period) * unit.period;
    if (result > kLongestExplored) return kUnbounded;
  }
  return static_cast<Duration>(result);
}

ExplorationModel exploration_model(const TaskSet &task_set, std::uint64_t max_jobs) {
  return Builder(task_set, max_jobs).run();
}

}  // namespace redag::analysis
