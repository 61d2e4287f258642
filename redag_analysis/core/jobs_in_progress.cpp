// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/core/jobs_in_progress.hpp"

#include <algorithm>
#include <vector>

#include "redag_analysis/core/effort.hpp"

namespace redag::analysis {
namespace {

// The largest antichain of a grid's tasks is as large as the least number of chains that cover them (R. Dilworth,
// Annals of Mathematics 51(1), 1950). A maximum matching between tasks and the tasks that follow them leaves that many
// chains (Kuhn).
class Antichain {
 public:
  Antichain(const TaskSet &task_set, const std::vector<std::uint32_t> &tasks)
      : count_(tasks.size()), follows_(count_, std::vector<bool>(count_, false)), next_(count_, kNone) {
    for (std::size_t b = 0; b < count_; ++b) {
      for (const std::uint32_t p : task_set.tasks[tasks[b]].predecessors) {
        const auto a = std::find(tasks.begin(), tasks.end(), p);
        if (a != tasks.end()) follows_[static_cast<std::size_t>(a - tasks.begin())][b] = true;
      }
    }
    for (std::size_t via = 0; via < count_; ++via) {
      for (std::size_t a = 0; a < count_; ++a) {
        if (!follows_[a][via]) continue;
        Effort::spend(count_);
        for (std::size_t b = 0; b < count_; ++b) follows_[a][b] = follows_[a][b] || follows_[via][b];
      }
    }
  }

  std::size_t size() {
    std::size_t chains = count_;
    for (std::size_t a = 0; a < count_; ++a) {
      Effort::spend(count_);
      visited_.assign(count_, false);
      if (extend(a)) --chains;
    }
    return chains;
  }

 private:
  static constexpr std::size_t kNone = SIZE_MAX;

  bool extend(std::size_t a) {
    for (std::size_t b = 0; b < count_; ++b) {
      if (visited_[b] || !follows_[a][b]) continue;
      visited_[b] = true;
      if (next_[b] == kNone || extend(next_[b])) {
        next_[b] = a;
        return true;
      }
    }
    return false;
  }

  std::size_t count_;
  std::vector<std::vector<bool>> follows_;
  std::vector<std::size_t> next_;  // by task: its predecessor in its chain
  std::vector<bool> visited_;
};

}  // namespace

std::size_t most_jobs_in_progress(const TaskSet &task_set, DagId dag) {
  std::vector<std::vector<std::uint32_t>> grids;
  for (const std::uint32_t t : task_set.dags[dag.value].tasks) {
    const auto grid = std::find_if(grids.begin(), grids.end(), [&](const std::vector<std::uint32_t> &tasks) {
      return is_released_with(task_set.tasks[tasks.front()], task_set.tasks[t]);
    });
    grid == grids.end() ? grids.push_back({t}) : grid->push_back(t);
  }
  std::size_t most = 0;
  for (const std::vector<std::uint32_t> &tasks : grids) most += Antichain(task_set, tasks).size();
  return most;
}

std::uint32_t most_side_by_side(const TaskSet &task_set, const std::vector<std::uint32_t> &tasks) {
  constexpr std::size_t kMost = 64;
  const std::size_t most = tasks.size() < 2 || tasks.size() > kMost ? tasks.size() : Antichain(task_set, tasks).size();
  return static_cast<std::uint32_t>(most);
}

}  // namespace redag::analysis
