// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/search/sensitivity.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <numeric>
#include <utility>

#include "redag_analysis/analyze/analyze.hpp"
#include "redag_analysis/core/arithmetic.hpp"
#include "redag_analysis/core/effort.hpp"

namespace redag::lab {
namespace {

// True if the utilization exceeds the workers. Exact arithmetic, rounded in favour of the workload.
bool is_overloaded(const analysis::TaskSet &task_set) {
  constexpr unsigned kBits = 40;
  Int128 sum = 0;
  for (const analysis::CompiledTask &task : task_set.tasks) {
    sum += (Int128{task.wcet - task.waits} << kBits) / task.period;
  }
  return sum > Int128{task_set.platform.workers} << kBits;
}

// Returns why analyze() does not accept the workload.
std::string obstacle_of(const Workload &workload, const analysis::AnalysisPlatform &platform) {
  const Result<analysis::TaskSet> task_set = analysis::compile(workload, platform);
  if (!task_set) return task_set.error().front().message;
  if (task_set->is_beyond_numbers) return task_set->not_analysable;
  if (const std::optional<std::string> why = why_impossible(*task_set)) return *why;
  const analysis::Report report = analysis::analyze(*task_set);
  std::optional<std::uint32_t> worst;
  Duration missing = 0;
  for (std::uint32_t t = 0; t < task_set->tasks.size(); ++t) {
    const analysis::CompiledTask &task = task_set->tasks[t];
    if (meets_deadline(task, report.tasks[t].bound)) continue;
    if (!report.tasks[t].response) return task.name + " has no bound";
    if (report.tasks[t].bound.of_ended) return "jobs of " + task.name + " can be lost";
    const Duration late = *report.tasks[t].response - std::min(task.deadline, task.limit);
    if (worst && late <= missing) continue;
    worst = t;
    missing = late;
  }
  if (worst) return "the bound of " + task_set->tasks[*worst].name + " exceeds its deadline";
  for (std::size_t d = 0; d < task_set->dags.size(); ++d) {
    const analysis::CompiledDag &dag = task_set->dags[d];
    if (dag.deadline > 0 && report.dags[d].response.value_or(kNever) > dag.deadline) {
      return "the end-to-end deadline of " + dag.name;
    }
  }
  return "not accepted";
}

// Searches the positions of one knob.
class SensitivitySearch {
 public:
  SensitivitySearch(const Workload &workload, const analysis::AnalysisPlatform &platform, const Knob &knob,
                    const Accepts &accepts, const SensitivityOptions &options)
      : workload_(workload), platform_(platform), accepts_(accepts), options_(options) {
    margin_.knob = knob;
    margin_.nominal = nominal_position(workload, knob);
  }

  std::optional<Margin> run() {
    analysis::Effort::Limits limits;
    limits.itemised.which = analysis::Itemised::Which::None;
    limits.stop = [this](const analysis::EffortAt &) { return std::string(is_stopped() ? "stopped" : ""); };
    const analysis::Effort effort(limits);
    try {
      return search();
    } catch (const analysis::Effort::GaveUp &gave_up) {
      if (gave_up.scope != &effort) throw;
      return std::nullopt;
    }
  }

 private:
  static constexpr std::int64_t kLightest = 1;  // position

  [[nodiscard]] bool is_stopped() const { return options_.stop && options_.stop(); }

  std::optional<Margin> search() {
    if (accepts(margin_.nominal)) {
      between(margin_.nominal, first_impossible(margin_.nominal));
    } else if (margin_.nominal > kLightest && accepts(kLightest)) {
      // A workload that is schedulable for its wcets is also schedulable for shorter ones.
      between(kLightest, margin_.nominal);
    } else {
      margin_.obstacle = obstacle_of(turned(workload_, margin_.knob, kLightest), platform_);
    }
    if (stopped_) return std::nullopt;
    if (margin_.position) {
      margin_.factor = load_factor(workload_, margin_.knob, *margin_.position);
      margin_.obstacle = obstacle_of(turned(workload_, margin_.knob, *margin_.position + 1), platform_);
    }
    return margin_;
  }

  bool accepts(std::int64_t position) {
    stopped_ = stopped_ || is_stopped();
    if (stopped_) return false;
    const Workload candidate = turned(workload_, margin_.knob, position);
    const Result<analysis::TaskSet> task_set = analysis::compile(candidate, platform_);
    return task_set && !why_impossible(*task_set) && accepts_(candidate, *task_set);
  }

  [[nodiscard]] bool is_impossible(std::int64_t position) const {
    const Result<analysis::TaskSet> task_set = analysis::compile(turned(workload_, margin_.knob, position), platform_);
    return !task_set || why_impossible(*task_set);
  }

  // Returns the first impossible position by bisection, which is exact: more load never makes an impossible workload
  // possible. Requires that `from` is possible.
  [[nodiscard]] std::int64_t first_impossible(std::int64_t from) const {
    std::int64_t low = from;
    std::int64_t high = 2 * from;
    while (high < kMaxDuration / 2 && !is_impossible(high)) {
      low = high;
      high *= 2;
    }
    while (high - low > 1) {
      const std::int64_t middle = std::midpoint(low, high);
      (is_impossible(middle) ? high : low) = middle;
    }
    return high;
  }

  // Narrows the margin. Requires that `low` is accepted and `high` is not.
  void between(std::int64_t low, std::int64_t high) {
    for (const std::int64_t position : spread(low, high)) {
      if (accepts(position)) {
        low = position;
      } else {
        high = position;
        break;
      }
    }
    while (high - low > 1 && !stopped_) {
      const std::int64_t middle = std::midpoint(low, high);
      (accepts(middle) ? low : high) = middle;
    }
    margin_.position = low;
  }

  // Returns evenly spread positions inside (low, high), ascending.
  [[nodiscard]] std::vector<std::int64_t> spread(std::int64_t low, std::int64_t high) const {
    std::vector<std::int64_t> positions;
    const auto count = static_cast<std::int64_t>(options_.probes);
    for (std::int64_t i = 1; i <= count; ++i) {
      const auto position = low + static_cast<std::int64_t>(Int128{high - low} * i / (count + 1));
      if (position > low && position < high && (positions.empty() || position > positions.back())) {
        positions.push_back(position);
      }
    }
    return positions;
  }

  const Workload &workload_;
  const analysis::AnalysisPlatform &platform_;
  const Accepts &accepts_;
  const SensitivityOptions &options_;
  Margin margin_;
  bool stopped_ = false;
};

}  // namespace

std::optional<std::string> why_impossible(const analysis::TaskSet &task_set) {
  for (std::uint32_t t = 0; t < task_set.tasks.size(); ++t) {
    const analysis::CompiledTask &task = task_set.tasks[t];
    // Jobs of a task that can overlap (concurrency) may take longer than the limit; such workloads are not analysed.
    const bool is_analysed = task_set.not_analysable.empty() || task_set.has_waits;
    const Duration due = is_analysed ? std::min(task.deadline, task.limit) : task.deadline;
    Duration alone = task.wcet;
    for (const analysis::DeviceUse &use : task.devices) alone -= use.blocked;
    if (alone > due) return task.name + " alone takes longer than its deadline allows";
  }
  if (is_overloaded(task_set)) return fmt::format("the utilization exceeds {}", task_set.platform.workers);
  return std::nullopt;
}

std::optional<Margin> margin_of(const Workload &workload, const analysis::AnalysisPlatform &platform, const Knob &knob,
                                const Accepts &accepts, const SensitivityOptions &options) {
  return SensitivitySearch(workload, platform, knob, accepts, options).run();
}

std::vector<Knob> knobs_of(const Workload &workload) {
  std::vector<std::uint32_t> all(workload.task_count());
  std::iota(all.begin(), all.end(), 0);
  std::vector<Knob> knobs = {{Knob::Kind::AllWcets, all}};
  for (const std::uint32_t t : all) knobs.push_back({Knob::Kind::Wcet, {t}});
  return knobs;
}

}  // namespace redag::lab
