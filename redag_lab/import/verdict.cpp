// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/import/verdict.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <tuple>
#include <utility>

#include "redag_lab/run/session.hpp"
#include "redag_lab/run/variant.hpp"
#include "redag_lab/search/analysed.hpp"

namespace redag::lab {
namespace {

constexpr std::size_t kMostTried = 8;  // groups and rates: each is a simulation and an analysis

class Judging {
 public:
  Judging(const ImportedWorkload &imported, const SelfCheck &check, JudgeOptions options)
      : imported_(imported), recorded_(check.executor), options_(std::move(options)) {
    verdict_.refused.assign(imported.workload.task_count(), "the recording does not say when its jobs were released");
    for (const ReproducedTask &task : check.tasks) {
      verdict_.refused[task.task.value] =
          task.is_reproduced()
              ? std::string()
              : fmt::format("recorded p50 {}, p99 {}; simulated {}, {}", humanize_duration(task.recorded.p50),
                            humanize_duration(task.recorded.p99), humanize_duration(task.simulated.p50),
                            humanize_duration(task.simulated.p99));
    }
  }

  Result<WhatIf> run() {
    for (const std::uint32_t workers : {imported_.workload.platform.workers, options_.other_workers}) {
      Workload workload = imported_.workload;
      workload.platform.workers = workers;
      for (const std::string &executor : {like_recorded(workers), std::string("redag-none"), std::string("redag-os")}) {
        Result<Outcome> outcome = outcome_of(workload, executor);
        if (!outcome) return tl::unexpected(std::move(outcome.error()));
        verdict_.outcomes.push_back(*std::move(outcome));
      }
    }
    verdict_.changes = {{"ReDAG-RT with preemption none", verdict_.outcomes[1]},
                        {"ReDAG-RT with preemption os", verdict_.outcomes[2]}};
    for (Change &change : possible_changes()) {
      Result<Outcome> outcome = outcome_of(change.robot, like_recorded(change.robot.platform.workers));
      if (!outcome) return tl::unexpected(std::move(outcome.error()));
      verdict_.changes.push_back({std::move(change.words), *std::move(outcome)});
    }
    keep_best_changes();
    return std::move(verdict_);
  }

 private:
  Result<Outcome> outcome_of(const Workload &workload, const std::string &executor) {
    constexpr double kMostSimulations = 7 + 2 * kMostTried;
    if (options_.progress) options_.progress(static_cast<double>(simulations_++) / kMostSimulations);
    const Result<Variant> variant = parse_variant(executor);
    if (!variant) return tl::unexpected(variant.error());
    Replayed replayed = replay(imported_, workload, *variant);
    replayed.options.stop = options_.stop;
    Result<Session> session = run_session(replayed.workload, *variant, replayed.options);
    if (!session) return tl::unexpected(std::move(session.error()));
    if (options_.stop != nullptr && options_.stop->load()) {
      return make_error("interrupted: there is no verdict", "record for less time, or leave out --verdict");
    }
    Outcome outcome{.executor = executor,
                    .workers = workload.platform.workers,
                    .summary = std::move(session->summary),
                    .held = held_by(workload, *variant)};
    const std::vector<TaskRef> refs = flatten(workload);
    for (const metrics::TaskSummary &task : outcome.summary.tasks) {
      const std::size_t t = task.task.value;
      if (!verdict_.refused[t].empty()) continue;
      outcome.released += task.jobs.released;
      outcome.missed += task.jobs.missed();
      if (outcome.held[t]) ++outcome.shown;
      outcome.worst_response = std::max(outcome.worst_response, static_cast<double>(task.jobs.response.p99) /
                                                                    static_cast<double>(refs[t].task->deadline));
    }
    return outcome;
  }

  // The phases of the recording are those of one start of the robot: the analysis covers all.
  std::vector<bool> held_by(const Workload &workload, const Variant &variant) const {
    std::vector<bool> held(workload.task_count(), false);
    const Result<Workload> configured = configure(workload, variant);
    if (!configured) return held;
    analysis::AnalysisPlatform platform = analysis::platform_of(*configured);
    platform.dispatch_overhead = imported_.overhead;
    const Result<Analysed> analysed = analyse(*configured, platform, variant.executor);
    if (!analysed) return held;
    for (const Row &row : task_rows(*analysed)) held[row.task.value] = row.standing == Standing::Ok;
    return held;
  }

  // An executor of one thread becomes another one with more of them.
  [[nodiscard]] std::string like_recorded(std::uint32_t workers) const { return workers > 1 ? "mte" : recorded_; }

  struct Change {
    std::string words;
    Workload robot;
  };

  [[nodiscard]] std::vector<Change> possible_changes() const {
    Workload more = imported_.workload;
    const std::uint32_t workers = more.platform.workers++;
    std::vector<Change> changes{{fmt::format("{} threads instead of {}", workers + 1, workers), more}};

    // Tasks by how much they take of a processor.
    std::vector<TaskRef> refs = flatten(imported_.workload);
    const auto share = [](const TaskRef &ref) {
      return static_cast<double>(ref.task->wcet) / static_cast<double>(ref.task->period);
    };
    std::stable_sort(refs.begin(), refs.end(), [&](const auto &a, const auto &b) { return share(a) > share(b); });
    std::size_t groups = 0;
    std::size_t rates = 0;
    for (const TaskRef &ref : refs) {
      const Task &task = *ref.task;
      if (!task.group.empty() && groups++ < kMostTried) {
        changes.push_back({task.name + " in a callback group of its own", imported_.workload});
        task_of(changes.back().robot, ref).group.clear();
      }
      if (task.activation != Activation::Data && rates++ < kMostTried) {
        const auto words = fmt::format("{} every {} instead of {}", task.name, humanize_duration(2 * task.period),
                                       humanize_duration(task.period));
        changes.push_back({words, imported_.workload});
        task_of(changes.back().robot, ref).period *= 2;
        inherit_periods(changes.back().robot.dags[ref.dag.value]);
      }
    }
    return changes;
  }

  static Task &task_of(Workload &workload, const TaskRef &ref) { return workload.dags[ref.dag.value].tasks[ref.index]; }

  // Rounded, so that chance makes no change better: misses, deadlines that are not shown, and the worst response.
  [[nodiscard]] std::tuple<double, std::size_t, double> badness(const Outcome &outcome) const {
    const double missed =
        static_cast<double>(outcome.missed) / static_cast<double>(std::max<std::uint64_t>(outcome.released, 1));
    return {std::ceil(missed * 1000), verdict_.judged() - outcome.shown, std::round(outcome.worst_response * 20)};
  }

  void keep_best_changes() {
    std::vector<TriedChange> &changes = verdict_.changes;
    const auto now = badness(verdict_.outcomes.front());
    std::erase_if(changes, [&](const TriedChange &change) { return badness(change.outcome) >= now; });
    std::stable_sort(changes.begin(), changes.end(), [&](const TriedChange &a, const TriedChange &b) {
      return badness(a.outcome) < badness(b.outcome);
    });
    if (changes.size() > kMostChanges) changes.resize(kMostChanges);
  }

  const ImportedWorkload &imported_;
  const std::string &recorded_;
  const JudgeOptions options_;
  int simulations_ = 0;
  WhatIf verdict_;
};

}  // namespace

std::size_t WhatIf::judged() const {
  return static_cast<std::size_t>(std::count(refused.begin(), refused.end(), std::string()));
}

Result<WhatIf> judge(const ImportedWorkload &imported, const SelfCheck &check, JudgeOptions options) {
  return Judging(imported, check, std::move(options)).run();
}

}  // namespace redag::lab
