// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/core/most_urgent.hpp"

#include <algorithm>
#include <set>
#include <utility>

#include "redag/sched/policy.hpp"

namespace redag::analysis {
namespace {

constexpr std::uint32_t kDropped = 0xffffffff;

// The places at which the order of tasks can be cut. A cut at `rank` keeps the tasks before it.
class Cuts {
 public:
  explicit Cuts(const TaskSet &task_set) : task_set_(task_set), is_cut_(task_set.by_rank.size(), true) {
    for (std::uint32_t rank = 1; rank < is_cut_.size(); ++rank) {
      is_cut_[rank] = task_of(rank).level != task_of(rank - 1).level && task_of(rank).tier != task_of(rank - 1).tier;
    }
    for (std::uint32_t t = 0; t < task_set.tasks.size(); ++t) {
      for (const std::uint32_t p : task_set.tasks[t].predecessors) {
        if (task_set.tasks[p].rank > task_set.tasks[t].rank) keep_together({p, t});
      }
    }
    for (const std::vector<std::uint32_t> &group : task_set.groups) keep_together(group);
    for (const CompiledDag &dag : task_set.dags) {
      if (dag.max_active > 0) keep_together(dag.tasks);
    }
    for (std::size_t d = 0; d < task_set.devices.size(); ++d) keep_together(users_of(d));
  }

  // The largest cut above a task with the feature; 0: none.
  template <class HasFeature>
  [[nodiscard]] std::uint32_t above(HasFeature has_feature) const {
    std::uint32_t rank = 0;
    while (rank < is_cut_.size() && !has_feature(task_set_.by_rank[rank])) ++rank;
    if (rank == is_cut_.size()) return 0;
    while (rank > 0 && !is_cut_[rank]) --rank;
    return rank;
  }

 private:
  [[nodiscard]] const CompiledTask &task_of(std::uint32_t rank) const {
    return task_set_.tasks[task_set_.by_rank[rank]];
  }

  [[nodiscard]] std::vector<std::uint32_t> users_of(std::size_t device) const {
    std::vector<std::uint32_t> users;
    for (std::uint32_t t = 0; t < task_set_.tasks.size(); ++t) {
      const std::vector<DeviceUse> &uses = task_set_.tasks[t].devices;
      if (device < uses.size() && uses[device].requests > 0) users.push_back(t);
    }
    return users;
  }

  void keep_together(const std::vector<std::uint32_t> &tasks) {
    if (tasks.empty()) return;
    std::uint32_t first = kDropped;
    std::uint32_t last = 0;
    for (const std::uint32_t t : tasks) {
      first = std::min(first, task_set_.tasks[t].rank);
      last = std::max(last, task_set_.tasks[t].rank);
    }
    for (std::uint32_t rank = first + 1; rank <= last; ++rank) is_cut_[rank] = false;
  }

  const TaskSet &task_set_;
  std::vector<bool> is_cut_;
};

// Less urgent jobs take no worker, group, device, thread or place of a max_active from these.
MostUrgent keep(const TaskSet &whole, std::uint32_t count) {
  MostUrgent part;
  std::vector<std::uint32_t> number(whole.tasks.size(), kDropped);
  for (std::uint32_t t = 0; t < whole.tasks.size(); ++t) {
    if (whole.tasks[t].rank >= count) continue;
    number[t] = static_cast<std::uint32_t>(part.tasks.size());
    part.tasks.push_back(t);
  }
  const auto renumber = [&](std::vector<std::uint32_t> &tasks) {
    std::erase_if(tasks, [&](std::uint32_t t) { return number[t] == kDropped; });
    for (std::uint32_t &t : tasks) t = number[t];
  };
  TaskSet &kept = part.task_set = whole;
  kept.not_analysable.clear();
  kept.has_waits = kept.threads_suffice_if_bounded = false;
  kept.tasks.clear();
  kept.utilization = 0;
  for (const std::uint32_t t : part.tasks) {
    kept.tasks.push_back(whole.tasks[t]);
    CompiledTask &task = kept.tasks.back();
    renumber(task.predecessors);
    renumber(task.successors);
    kept.utilization += static_cast<double>(task.wcet - task.waits) / static_cast<double>(task.period);
  }
  renumber(kept.by_rank);
  kept.groups.clear();
  for (std::vector<std::uint32_t> group : whole.groups) {
    renumber(group);
    for (const std::uint32_t t : group) kept.tasks[t].group = static_cast<std::uint32_t>(kept.groups.size());
    if (!group.empty()) kept.groups.push_back(std::move(group));
  }
  kept.units.clear();
  for (CompiledDag &dag : kept.dags) {
    renumber(dag.tasks);
    dag.units.clear();
  }
  for (const Unit &unit : whole.units) {
    std::vector<std::uint32_t> tasks = unit.tasks;
    renumber(tasks);
    if (tasks.empty()) continue;
    const auto id = static_cast<std::uint32_t>(kept.units.size());
    for (const std::uint32_t t : tasks) kept.tasks[t].unit = id;
    kept.dags[unit.dag.value].units.push_back(id);
    kept.units.push_back(make_unit(kept, unit.dag, std::move(tasks)));
    // It stays a part of its DAG's one grid, also without edges.
    kept.units.back().keeps_grid = unit.keeps_grid;
    kept.units.back().limit = std::min(kept.units.back().limit, unit.limit);
  }
  refuse_tasks(kept);
  refuse_waits(kept);
  return part;
}

}  // namespace

std::vector<MostUrgent> most_urgent(const TaskSet &task_set) {
  const std::uint32_t threads = task_set.platform.max_started;
  if (task_set.mode != sched::Preemption::Full || !is_static(task_set.policy) || task_set.is_refused_whole ||
      (threads > 0 && threads < task_set.tasks.size())) {
    return {};
  }
  const Cuts cuts(task_set);
  const auto unit_of = [&](std::uint32_t t) -> const Unit & { return task_set.units[task_set.tasks[t].unit]; };
  const std::set<std::uint32_t> counts = {
      cuts.above([&](std::uint32_t t) { return !task_set.tasks[t].refusal.empty(); }),
      cuts.above([&](std::uint32_t t) { return task_set.tasks[t].wake_ups > 0; }),
      cuts.above([&](std::uint32_t t) { return task_set.tasks[t].group != kNoGroup; }),
      cuts.above([&](std::uint32_t t) { return !unit_of(t).awaits.empty(); }),
      cuts.above([&](std::uint32_t t) {
        const CompiledDag &dag = task_set.dags[task_set.tasks[t].dag.value];
        return dag.max_active > 0 && dag.units.size() > 1;
      }),
      cuts.above([&](std::uint32_t t) {
        const Unit &unit = unit_of(t);
        return unit.last_rank - unit.first_rank >= unit.tasks.size();
      }),
  };
  std::vector<MostUrgent> parts;
  for (const std::uint32_t count : counts) {
    if (count > 0) parts.push_back(keep(task_set, count));
  }
  return parts;
}

ResponseBound in_whole(const MostUrgent &part, ResponseBound bound) {
  for (Term &term : bound.terms) {
    if (term.task.valid()) term.task = TaskId(part.tasks[term.task.value]);
  }
  return bound;
}

}  // namespace redag::analysis
