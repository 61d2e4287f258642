// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/search/sensitivity.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <numeric>
#include <set>
#include <utility>

#include "redag_analysis/analyze/analyze.hpp"
#include "redag_analysis/core/arithmetic.hpp"
#include "redag_analysis/core/effort.hpp"

namespace redag::lab {
namespace {

constexpr std::int64_t kSlowest = 1024;                // periods grow to at most this multiple,
constexpr Duration kLongestPeriod = 86'400 * kSecond;  // and to at most this length

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
  [[nodiscard]] bool is_stopped() const { return options_.stop && options_.stop(); }

  std::optional<Margin> search() {
    if (accepts(margin_.nominal)) {
      between(margin_.nominal, first_impossible(margin_.nominal));
    } else if (const std::optional<std::int64_t> start = light_start(); start && !stopped_) {
      between(*start, margin_.nominal);
    } else {
      margin_.obstacle = obstacle_of(turned(workload_, margin_.knob, lightest()), platform_);
    }
    if (stopped_) return std::nullopt;
    if (margin_.position) {
      margin_.factor = load_factor(workload_, margin_.knob, *margin_.position);
      const bool at_end = margin_.knob.kind == Knob::Kind::Period && *margin_.position == -1;
      margin_.obstacle = at_end ? "the resolution of the clock"
                                : obstacle_of(turned(workload_, margin_.knob, *margin_.position + 1), platform_);
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
    if (margin_.knob.kind == Knob::Kind::Period && position >= 0) return true;
    const Result<analysis::TaskSet> task_set = analysis::compile(turned(workload_, margin_.knob, position), platform_);
    return !task_set || why_impossible(*task_set);
  }

  // Returns the first impossible position by bisection, which is exact: more load never makes an impossible workload
  // possible. Requires that `from` is possible.
  [[nodiscard]] std::int64_t first_impossible(std::int64_t from) const {
    std::int64_t low = from;
    std::int64_t high = 0;
    if (margin_.knob.kind != Knob::Kind::Period) {
      high = 2 * from;
      while (high < kMaxDuration / 2 && !is_impossible(high)) {
        low = high;
        high *= 2;
      }
    }
    while (high - low > 1) {
      const std::int64_t middle = std::midpoint(low, high);
      (is_impossible(middle) ? high : low) = middle;
    }
    return high;
  }

  // Returns the lightest position that is tried.
  [[nodiscard]] std::int64_t lightest() const {
    if (margin_.knob.kind == Knob::Kind::Wcet || margin_.knob.kind == Knob::Kind::AllWcets) return 1;
    const std::vector<TaskRef> tasks = flatten(workload_);
    Duration longest = 1;
    for (const std::uint32_t t : margin_.knob.tasks) longest = std::max(longest, tasks[t].task->period);
    const std::int64_t slower = std::clamp<std::int64_t>(kLongestPeriod / longest, 1, kSlowest);
    return margin_.knob.kind == Knob::Kind::Period ? margin_.nominal * slower : margin_.nominal / slower;
  }

  // Returns an accepted position below the nominal one: the lightest position, or else the lightest accepted probe.
  std::optional<std::int64_t> light_start() {
    const std::int64_t least = lightest();
    if (least >= margin_.nominal) return std::nullopt;
    if (accepts(least)) return least;
    // A workload that is schedulable for its wcets is also schedulable for shorter ones. No lighter position is left to
    // try.
    if (margin_.knob.kind == Knob::Kind::Wcet || margin_.knob.kind == Knob::Kind::AllWcets) return std::nullopt;
    for (const std::int64_t position : spread(least, margin_.nominal)) {
      if (accepts(position)) return position;
    }
    return std::nullopt;
  }

  // Narrows the margin. Requires that `low` is accepted and `high` is not.
  void between(std::int64_t low, std::int64_t high) {
    const std::vector<std::int64_t> even = spread(low, high);
    std::set<std::int64_t> positions(even.begin(), even.end());
    add_changes_of_order(low, high, positions);
    for (const std::int64_t position : positions) {
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

  // Returns evenly spread positions inside (low, high), ascending. Periods are spread evenly by rate.
  [[nodiscard]] std::vector<std::int64_t> spread(std::int64_t low, std::int64_t high) const {
    std::vector<std::int64_t> positions;
    const auto count = static_cast<std::int64_t>(options_.probes);
    for (std::int64_t i = 1; i <= count; ++i) {
      std::int64_t position = 0;
      if (margin_.knob.kind == Knob::Kind::Period) {
        const double slow = 1.0 / static_cast<double>(-low);
        const double fast = high < 0 ? 1.0 / static_cast<double>(-high) : 1.0;
        const double rate = slow + (fast - slow) * static_cast<double>(i) / static_cast<double>(count + 1);
        position = -static_cast<std::int64_t>(1.0 / rate);
      } else {
        position = low + static_cast<std::int64_t>(Int128{high - low} * i / (count + 1));
      }
      if (position > low && position < high && (positions.empty() || position > positions.back())) {
        positions.push_back(position);
      }
    }
    return positions;
  }

  // Adds the positions at which the order of priorities changes, where periods or deadlines determine it. Between two
  // such neighbours the order is constant. If the larger load is accepted with bounds for sporadic releases, the
  // smaller loads between are safe as well.
  void add_changes_of_order(std::int64_t low, std::int64_t high, std::set<std::int64_t> &positions) const {
    const bool is_rate = margin_.knob.kind == Knob::Kind::Period || margin_.knob.kind == Knob::Kind::Rates;
    const bool order_follows = workload_.policy == PolicyKind::RateMonotonic ||
                               workload_.policy == PolicyKind::DeadlineMonotonic ||
                               workload_.policy == PolicyKind::ChainAware;
    if (!is_rate || !order_follows) return;
    const auto offer = [&](std::int64_t position) {
      if (position > low && position < high) positions.insert(position);
    };
    const std::vector<TaskRef> tasks = flatten(workload_);
    std::set<Duration> others;
    for (const TaskRef &ref : tasks) {
      others.insert(ref.task->period);
      others.insert(ref.task->deadline);
    }
    std::set<Duration> own;
    for (const std::uint32_t t : margin_.knob.tasks) own.insert(tasks[t].task->period);
    for (const Duration other : others) {
      if (margin_.knob.kind == Knob::Kind::Period) {
        for (const std::int64_t step : {-1, 0, 1}) offer(-other + step);
        continue;
      }
      for (const Duration period : own) {
        // Offers the last factors at which the rounded period is still above the other one, and still equal to it.
        for (const Duration edge : {other + 1, other}) {
          const auto last = static_cast<std::int64_t>(analysis::saturate(Int128{period} * kFactorUnit / edge));
          offer(last);
          offer(last + 1);
        }
      }
    }
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

std::vector<Knob> knobs_of(const Workload &workload, const analysis::TaskSet &task_set) {
  const std::vector<TaskRef> tasks = flatten(workload);
  std::vector<std::uint32_t> all(tasks.size());
  std::iota(all.begin(), all.end(), 0);
  std::vector<Knob> knobs = {{Knob::Kind::AllWcets, all}, {Knob::Kind::Rates, all}};
  for (const std::uint32_t t : all) knobs.push_back({Knob::Kind::Wcet, {t}});
  for (const analysis::Unit &unit : task_set.units) {
    // Data tasks that join several rates have no rate of their own.
    const auto is_timer = [&](std::uint32_t t) { return tasks[t].task->activation == Activation::Timer; };
    if (std::any_of(unit.tasks.begin(), unit.tasks.end(), is_timer)) knobs.push_back({Knob::Kind::Period, unit.tasks});
  }
  return knobs;
}

}  // namespace redag::lab
