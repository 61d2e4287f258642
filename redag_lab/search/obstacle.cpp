// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/search/obstacle.hpp"

#include <algorithm>
#include <utility>
#include <vector>

#include "redag_lab/search/remedy.hpp"

namespace redag::lab {
namespace {

// How good it is to stand there.
int order(Standing standing) {
  switch (standing) {
    case Standing::NoBound: return 0;
    case Standing::MayLose: return 1;
    case Standing::MayMiss: return 2;
    case Standing::NoDeadline:
    case Standing::Ok: break;
  }
  return 3;
}

// Takes one key away. Returns false if the task or DAG does not have it, or if it keeps nothing from a bound.
using Removal = std::pair<const char *, bool (*)(Task &)>;
constexpr Removal kOfTasks[] = {
    {"budget",
     [](Task &task) {
       const bool is_there = task.budget > 0 && task.budget < task.wcet && task.on_budget != OnBudget::Log;
       task.budget = 0;
       task.on_budget = OnBudget::Abort;
       return is_there;
     }},
    {"wcet_low", [](Task &task) { return std::exchange(task.wcet_low, 0) > 0; }},
    {"concurrency", [](Task &task) { return std::exchange(task.concurrency, 1) > 1; }},
    {"group", [](Task &task) { return !std::exchange(task.group, {}).empty(); }},
};
constexpr std::pair<const char *, std::uint32_t Dag::*> kOfDags[] = {{"max_pending", &Dag::max_pending},
                                                                     {"max_active", &Dag::max_active}};

class ObstacleSearch {
 public:
  ObstacleSearch(const Analysed &analysed, const Row &row) : analysed_(analysed), row_(row) {}

  std::optional<Obstacle> run() {
    const std::vector<TaskId> suspects = suspects_of(analysed_, row_);
    const std::vector<Dag> &dags = analysed_.workload.dags;
    std::uint32_t id = 0;
    for (std::uint32_t d = 0; d < dags.size(); ++d) {
      bool is_suspect = false;
      for (std::uint32_t t = 0; t < dags[d].tasks.size(); ++t, ++id) {
        if (std::find(suspects.begin(), suspects.end(), TaskId(id)) == suspects.end()) continue;
        is_suspect = true;
        for (const auto &[key, remove] : kOfTasks) {
          Workload changed = analysed_.workload;
          if (remove(changed.dags[d].tasks[t])) consider(changed, Obstacle{DagId(d), TaskId(id), key, {}, {}});
        }
      }
      for (const auto &[key, member] : kOfDags) {
        Workload changed = analysed_.workload;
        if (is_suspect && std::exchange(changed.dags[d].*member, 0) > 0) {
          consider(changed, Obstacle{DagId(d), {}, key, {}, {}});
        }
      }
    }
    return best_;
  }

 private:
  void consider(const Workload &changed, Obstacle obstacle) {
    const Result<Analysed> without =
        analyse(changed, analysed_.task_set.platform, std::string(analysed_.executor->name));
    if (!without) return;
    const Row row = row_.task.valid() ? task_rows(*without)[row_.task.value] : dag_rows(*without)[row_.dag.value];
    obstacle.standing = row.standing;
    obstacle.response = row.tightest.response;
    const auto rank = [](Standing standing, std::optional<Duration> response) {
      return std::pair(order(standing), -response.value_or(0));
    };
    const bool is_better = best_ ? rank(row.standing, obstacle.response) > rank(best_->standing, best_->response)
                                 : order(row.standing) > order(row_.standing);
    if (is_better) best_ = std::move(obstacle);
  }

  const Analysed &analysed_;
  const Row &row_;
  std::optional<Obstacle> best_;
};

}  // namespace

std::optional<Obstacle> find_obstacle(const Analysed &analysed, const Row &row) {
  if (analysed.workload.task_count() > kMostTasksForRemedy) return std::nullopt;
  return ObstacleSearch(analysed, row).run();
}

}  // namespace redag::lab
