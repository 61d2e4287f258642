// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/sched/policy.hpp"

#include <algorithm>
#include <array>
#include <tuple>

namespace redag::sched {
namespace {

// What a policy sorts by, smallest first. Equal keys are ordered by DAG, topological rank and TaskId.
using PolicyKey = std::array<std::int64_t, 4>;

PolicyKey policy_key(PolicyKind policy, const RankedTask &task) {
  switch (policy) {
    case PolicyKind::RateMonotonic: return {task.period};
    case PolicyKind::DeadlineMonotonic: return {task.deadline};
    case PolicyKind::Fixed: return {-std::int64_t{task.priority}};
    // PiCAS (Choi, Xiang, Kim, RTAS 2021): orders by chain, and within a chain downstream first. One instance of a
    // chain thus finishes before the next one starts.
    case PolicyKind::ChainAware:
      return {-static_cast<std::int64_t>(task.dag_criticality), task.dag_period, task.dag,
              -std::int64_t{task.topological_rank}};
    case PolicyKind::Edf:
    case PolicyKind::Fifo: break;
  }
  return {};
}

struct Entry {
  PolicyKey key{};
  std::uint32_t dag = 0;
  std::uint32_t topological_rank = 0;
  TaskId task;
  std::size_t position = 0;  // index in the input
};

std::vector<Entry> sorted_entries(std::span<const RankedTask> tasks, PolicyKind policy) {
  std::vector<Entry> entries;
  entries.reserve(tasks.size());
  for (std::size_t i = 0; i < tasks.size(); ++i) {
    const RankedTask &task = tasks[i];
    entries.push_back(Entry{policy_key(policy, task), task.dag, task.topological_rank, task.task, i});
  }
  std::sort(entries.begin(), entries.end(), [](const Entry &a, const Entry &b) {
    return std::tie(a.key, a.dag, a.topological_rank, a.task) < std::tie(b.key, b.dag, b.topological_rank, b.task);
  });
  return entries;
}

}  // namespace

std::vector<Priority> assign_priorities(std::span<const RankedTask> tasks, PolicyKind policy, Ties ties,
                                        std::uint32_t levels) {
  const std::vector<Entry> entries = sorted_entries(tasks, policy);
  std::vector<Priority> priorities(entries.size());

  const bool takes_turns = ties == Ties::Share && is_static(policy);
  std::uint32_t classes = 0;  // runs of entries with equal keys
  for (std::size_t i = 0; i < entries.size(); ++i) {
    if (i == 0 || entries[i].key != entries[i - 1].key) ++classes;
  }
  const std::uint32_t tiers = takes_turns ? classes : static_cast<std::uint32_t>(entries.size());
  const bool own_levels = levels == 0 || levels >= tiers || !is_static(policy);

  std::uint32_t class_index = 0;
  for (std::uint32_t rank = 0; rank < entries.size(); ++rank) {
    if (rank > 0 && entries[rank].key != entries[rank - 1].key) ++class_index;
    const std::uint32_t tier = takes_turns ? class_index : rank;
    std::uint32_t level = tier;
    if (!own_levels) {
      level =
          classes <= levels ? class_index : static_cast<std::uint32_t>(std::uint64_t{class_index} * levels / classes);
    }
    priorities[entries[rank].position] = Priority{rank, tier, level};
  }
  return priorities;
}

std::vector<Priority> assign_priorities(std::span<const Dag> dags, PolicyKind policy, Ties ties, std::uint32_t levels) {
  std::vector<RankedTask> tasks;
  for (std::uint32_t d = 0; d < dags.size(); ++d) {
    const Dag &dag = dags[d];
    const std::vector<std::uint32_t> topological = topological_ranks(dag);
    Duration shortest = kNever;
    for (const Task &task : dag.tasks) shortest = std::min(shortest, task.period);
    for (std::size_t i = 0; i < dag.tasks.size(); ++i) {
      const Task &task = dag.tasks[i];
      tasks.push_back(RankedTask{task.period, task.deadline, task.priority.value_or(0), dag.criticality, shortest, d,
                                 topological[i], TaskId(tasks.size())});
    }
  }
  return assign_priorities(tasks, policy, ties, levels);
}

}  // namespace redag::sched
