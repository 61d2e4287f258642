// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/many_workers/dag_isolated.hpp"

#include <algorithm>
#include <iterator>
#include <map>

#include "redag/sched/policy.hpp"
#include "redag_analysis/core/arithmetic.hpp"
#include "redag_analysis/core/effort.hpp"
#include "redag_analysis/core/rate_edges.hpp"
#include "redag_analysis/many_workers/global.hpp"

namespace redag::analysis {
namespace {

using global::GlobalUnit;

// Returns the tasks of the heaviest path by the weights that are left, and removes their weights.
std::vector<std::uint32_t> take_heaviest_path(const TaskSet &task_set, const Unit &unit,
                                              std::map<std::uint32_t, Duration> &left) {
  struct Step {
    Duration length = 0;
    std::uint32_t before = TaskId::kNoneValue;
  };
  std::map<std::uint32_t, Step> paths;
  std::uint32_t last = unit.tasks.front();
  for (const std::uint32_t t : unit.tasks) {
    Step step;
    for (const std::uint32_t p : task_set.tasks[t].predecessors) {
      if (paths[p].length > step.length) step = Step{paths[p].length, p};
    }
    step.length += left[t];
    paths[t] = step;
    if (step.length > paths[last].length) last = t;
  }
  Effort::spend(unit.tasks.size());
  std::vector<std::uint32_t> taken;
  for (std::uint32_t t = last; t != TaskId::kNoneValue; t = paths[t].before) {
    if (left[t] > 0) taken.push_back(t);
    left[t] = 0;
  }
  return taken;
}

Duration graham_response(const Unit &unit, std::uint32_t workers) {
  return unit.length + (unit.volume - unit.length) / workers;
}

// Builds the bound; `response` counts from the release as seen.
ResponseBound bound_of(const TaskSet &task_set, const GlobalUnit &unit, Duration response) {
  ResponseBound bound;
  if (add(response, unit.jitter) > unit.limit) {
    bound.absent = global::kExceedsLimit;
    return bound;
  }
  bound.response = response + unit.jitter;
  global::SharedTerms terms(task_set, unit);
  terms.add_path();
  terms.add(Term::Kind::Own, unit, response - unit.length);
  terms.add_jitter();
  bound.terms = terms.take();
  return bound;
}

// The most jobs of the DAG that can be started and unfinished at once.
std::uint32_t most_started(const CompiledDag &dag) {
  return dag.max_active > 0 ? dag.max_active : static_cast<std::uint32_t>(dag.tasks.size());
}

// True if a job that starts takes a worker from any less urgent job at once.
bool preempts_at_once(const TaskSet &task_set) {
  const auto has_own_level = [](const CompiledTask &task) { return task.level == task.tier; };
  return task_set.mode == sched::Preemption::Full && is_static(task_set.policy) &&
         std::all_of(task_set.tasks.begin(), task_set.tasks.end(), has_own_level);
}

// How many jobs of all DAGs that can take a worker from one of a tier can be started.
class Interference {
 public:
  explicit Interference(const TaskSet &task_set) {
    const bool is_ordered = preempts_at_once(task_set);
    for (const CompiledDag &dag : task_set.dags) {
      if (dag.tasks.empty()) continue;
      std::uint32_t first_tier = task_set.tasks[dag.tasks.front()].tier;
      for (const std::uint32_t t : dag.tasks) first_tier = std::min(first_tier, task_set.tasks[t].tier);
      // Unless urgent jobs preempt at once, every DAG can keep a worker from every other one.
      started_[is_ordered ? first_tier : 0] += most_started(dag);
    }
    std::uint64_t sum = 0;
    for (auto &[tier, started] : started_) started = sum += started;
  }

  [[nodiscard]] std::uint64_t down_to(std::uint32_t tier) const {
    const auto next = started_.upper_bound(tier);
    return next == started_.begin() ? 0 : std::prev(next)->second;
  }

 private:
  std::map<std::uint32_t, std::uint64_t> started_;  // by the first tier of DAGs: theirs, and all of earlier tiers
};

// The number of workers that no other DAG can keep from this one: as many as it can use, or all, or 0.
std::uint32_t own_workers(const TaskSet &task_set, const CompiledDag &dag, const Interference &interference) {
  std::uint32_t last_tier = 0;
  for (const std::uint32_t t : dag.tasks) last_tier = std::max(last_tier, task_set.tasks[t].tier);
  const std::uint32_t wanted = most_started(dag);
  const std::uint64_t all = interference.down_to(last_tier);  // it is among them
  const std::uint32_t workers = task_set.platform.workers;
  if (all <= workers) return wanted;
  // With fewer workers than its own bound it would compete with others for them; a DAG without others does not.
  const bool alone = all == wanted && dag.units.size() == 1 && task_set.mode != sched::Preemption::Cooperative;
  return alone ? workers : 0;
}

Outcome apply_isolated(const TaskSet &task_set) {
  if (auto reason = why_not_directly(task_set)) return NotApplicable{*reason};
  if (!task_set.groups.empty()) return NotApplicable{"with exclusive groups, a worker can be idle while a job waits"};
  std::vector<ResponseBound> responses(task_set.units.size());
  bool any = false;
  const Interference interference(task_set);
  for (const CompiledDag &dag : task_set.dags) {
    const std::uint32_t workers = own_workers(task_set, dag, interference);
    any = any || workers > 0;
    for (const std::uint32_t u : dag.units) {
      const Unit &unit = task_set.units[u];
      if (workers == 0) {
        responses[u].absent = "this DAG and those that interfere with it can occupy more than all workers";
      } else if (dag.max_active > 0 && dag.units.size() > 1) {
        responses[u].absent = "several parts of the DAG share one max_active";
      } else {
        const bool one_each = workers >= dag.tasks.size();
        const Duration own = one_each ? unit.length : long_paths_response(task_set, unit, workers);
        responses[u] = bound_of(task_set, global::unit_of(task_set, u), own);
      }
    }
  }
  if (!any)
    return NotApplicable{
        "no DAG has workers of its own: the max_active of a DAG and of those that delay it exceed the workers"};
  return from_units(task_set, std::move(responses));
}

}  // namespace

std::vector<Duration> disjoint_paths(const TaskSet &task_set, const Unit &unit, std::size_t count, Heaviest heaviest) {
  std::map<std::uint32_t, Duration> left;
  for (const std::uint32_t t : unit.tasks) left[t] = heaviest == Heaviest::MostTasks ? 1 : task_set.tasks[t].wcet;
  std::vector<Duration> paths;
  for (Duration covered = 0; paths.size() < count && covered < unit.volume; covered += paths.back()) {
    paths.push_back(0);
    for (const std::uint32_t t : take_heaviest_path(task_set, unit, left)) paths.back() += task_set.tasks[t].wcet;
  }
  return paths;
}

Duration long_paths_response(const TaskSet &task_set, const Unit &unit, std::uint32_t workers) {
  const std::vector<Duration> paths = disjoint_paths(task_set, unit, workers, Heaviest::Longest);
  Duration best = graham_response(unit, workers);
  Duration covered = unit.length;
  for (std::uint32_t j = 1; j < paths.size(); ++j) {
    covered += paths[j];
    best = std::min(best, unit.length + (unit.volume - covered) / (workers - j));
  }
  return best;
}

Method isolated() {
  return Method{
      .name = "isolated",
      .subject = Subject::Dag,
      .cite =
          "docs/analysis.md, \"Isolation\"; J. Li, J. Chen, K. Agrawal, C. Lu, C. Gill, A. Saifullah, Analysis of "
          "federated and global scheduling for parallel real-time tasks, ECRTS 2014; Q. He, N. Guan, M. "
          "Lv, X. Jiang, W. Chang, Bounding the response time of DAG tasks using long paths, RTSS 2022",
      .assumptions =
          "the max_active of the DAG and of all that can take a worker from it sum up to at most m; any policy and "
          "mode; one rate per DAG with edges, R <= T; no shared groups",
      .complexity = "O(tasks log DAGs + workers (tasks + edges))",
      .apply = apply_isolated,
  };
}

}  // namespace redag::analysis
