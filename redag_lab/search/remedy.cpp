// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/search/remedy.hpp"

#include <algorithm>

#include <fmt/format.h>

#include "redag/sched/policy.hpp"
#include "redag_analysis/analyze/analyze.hpp"
#include "redag_analysis/text/rounded_time.hpp"
#include "redag_lab/search/sensitivity.hpp"

namespace redag::lab {
namespace {

constexpr std::size_t kMostSuspects = 6;
constexpr double kLittle = 0.9;  // a remedy that keeps at least this share of an execution time counts as small

class RemedySearch {
 public:
  RemedySearch(const Workload &workload, const analysis::AnalysisPlatform &platform)
      : workload_(workload), platform_(platform) {}

  std::optional<std::string> run(const std::vector<TaskId> &suspects) {
    const std::optional<Shorter> shorter = shorten(suspects);
    if (shorter && shorter->factor >= kLittle) return shorter->words;
    if (auto words = lift_max_active()) return words;
    if (auto words = preempt()) return words;
    if (auto words = leave_group()) return words;
    if (auto words = add_worker()) return words;
    return shorter ? std::optional(shorter->words) : std::nullopt;
  }

 private:
  struct Shorter {
    double factor = 0;
    std::string words;
  };

  [[nodiscard]] bool suffices(const Workload &changed, const analysis::AnalysisPlatform &platform) const {
    const Result<analysis::TaskSet> task_set = analysis::compile(changed, platform);
    return task_set && analysis::is_shown_schedulable(*task_set);
  }

  [[nodiscard]] std::string name_of(TaskId id) const {
    std::size_t first = 0;
    for (const Dag &dag : workload_.dags) {
      if (id.value < first + dag.tasks.size()) return dag.name + "." + dag.tasks[id.value - first].name;
      first += dag.tasks.size();
    }
    return "?";
  }

  // Returns the execution time that has to shrink least.
  [[nodiscard]] std::optional<Shorter> shorten(const std::vector<TaskId> &suspects) const {
    SensitivityOptions options;
    options.probes = 2;
    std::optional<Shorter> best;
    for (std::size_t i = 0; i < std::min(suspects.size(), kMostSuspects); ++i) {
      const Knob knob{Knob::Kind::Wcet, {suspects[i].value}};
      const std::optional<Margin> margin = margin_of(workload_, platform_, knob, accepted_by_analysis, options);
      if (!margin || !margin->position || (best && best->factor >= margin->factor)) continue;
      best = Shorter{margin->factor, fmt::format("wcet of {}: {} instead of {}", name_of(suspects[i]),
                                                 humanize_down(*margin->position), humanize_duration(margin->nominal))};
    }
    return best;
  }

  [[nodiscard]] std::optional<std::string> lift_max_active() const {
    for (std::size_t d = 0; d < workload_.dags.size(); ++d) {
      if (workload_.dags[d].max_active == 0) continue;
      Workload changed = workload_;
      changed.dags[d].max_active = 0;
      if (suffices(changed, platform_)) return fmt::format("DAG {}: no max_active", workload_.dags[d].name);
    }
    return std::nullopt;
  }

  [[nodiscard]] std::optional<std::string> preempt() const {
    if (platform_.preemption == sched::Preemption::Full || !is_static(workload_.policy)) return std::nullopt;
    analysis::AnalysisPlatform platform = platform_;
    platform.preemption = sched::Preemption::Full;
    if (!suffices(workload_, platform)) return std::nullopt;
    return "preemption: os, so that urgent jobs do not wait for others to end";
  }

  [[nodiscard]] std::optional<std::string> leave_group() const {
    for (std::size_t d = 0; d < workload_.dags.size(); ++d) {
      for (std::size_t t = 0; t < workload_.dags[d].tasks.size(); ++t) {
        const Task &task = workload_.dags[d].tasks[t];
        if (task.group.empty()) continue;
        Workload changed = workload_;
        changed.dags[d].tasks[t].group.clear();
        if (!suffices(changed, platform_)) continue;
        return fmt::format("task {}.{}: remove it from group '{}'", workload_.dags[d].name, task.name, task.group);
      }
    }
    return std::nullopt;
  }

  [[nodiscard]] std::optional<std::string> add_worker() const {
    Workload changed = workload_;
    analysis::AnalysisPlatform platform = platform_;
    changed.platform.workers = ++platform.workers;
    const std::size_t cpus = changed.platform.cpus.size();
    if (cpus != 0 && changed.platform.workers > cpus) return std::nullopt;
    if (!suffices(changed, platform)) return std::nullopt;
    return fmt::format("workers: {} instead of {}", platform.workers, platform_.workers);
  }

  const Workload &workload_;
  const analysis::AnalysisPlatform &platform_;
};

}  // namespace

std::optional<std::string> find_remedy(const Workload &workload, const analysis::AnalysisPlatform &platform,
                                       const std::vector<TaskId> &suspects) {
  if (workload.task_count() > kMostTasksForRemedy) return std::nullopt;
  return RemedySearch(workload, platform).run(suspects);
}

}  // namespace redag::lab
