// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/search/tune.hpp"

#include <oneapi/tbb/global_control.h>
#include <oneapi/tbb/parallel_for.h>
#include <oneapi/tbb/task_arena.h>

#include <algorithm>
#include <span>
#include <utility>

#include "redag/model/demand.hpp"
#include "redag_analysis/analyze/analyze.hpp"

namespace redag::lab {
namespace {

class Tuner {
 public:
  Tuner(const Workload &workload, const TuneOptions &options)
      : options_(options),
        settings_(workload, options.freedom),
        jobs_(options.jobs == 0 ? tbb::this_task_arena::max_concurrency() : static_cast<int>(options.jobs)),
        allow_(tbb::global_control::max_allowed_parallelism, static_cast<std::size_t>(jobs_)),
        arena_(jobs_) {}

  std::optional<Tuned> run() {
    const auto better = [this](const RunScore &a, const RunScore &b) { return is_better(a, b, options_.goal); };
    CoordinateSearch<RunScore> search([this](std::span<const Point> points) { return scores_of(points); }, better);
    auto found = search.run(settings_.space(), options_.effort);
    if (found.trials.empty()) return std::nullopt;

    Tuned tuned;
    tuned.present = candidate(settings_.space().starts.front(), found.trials);
    // The workload stays as it is unless the goal prefers another one.
    const bool is_improved = improves(found.score, tuned.present.score, options_.goal);
    tuned.found = is_improved ? candidate(found.best, found.trials) : tuned.present;
    tuned.exhaustive = found.exhaustive;
    tuned.stopped = found.stopped;
    tuned.trials = std::move(found.trials);
    tuned.varies = varies(tuned.present.workload);
    hold_out(tuned);
    return tuned;
  }

 private:
  using Run = std::array<ClassScore, kCriticalities>;

  static bool varies(const Workload &workload) {
    return std::any_of(workload.dags.begin(), workload.dags.end(),
                       [](const Dag &dag) { return std::any_of(dag.tasks.begin(), dag.tasks.end(), demand_varies); });
  }

  SettingCandidate candidate(const Point &point, const std::map<Point, RunScore> &trials) const {
    return SettingCandidate{point, settings_.apply(point), trials.at(point), {}, {}};
  }

  // Simulates every workload with every seed, on all processors of the arena. If stopped, the result holds only the
  // first workloads, each with all its seeds.
  std::vector<std::vector<Run>> simulate(const std::vector<Workload> &workloads, std::uint64_t first_seed,
                                         std::uint32_t seeds, const std::atomic<bool> *stop) {
    std::vector<std::vector<std::optional<Run>>> runs(workloads.size(), std::vector<std::optional<Run>>(seeds));
    arena_.execute([&] {
      tbb::parallel_for(std::size_t{0}, workloads.size() * seeds, [&](std::size_t i) {
        const std::size_t w = i / seeds;
        const std::size_t s = i % seeds;
        runs[w][s] = simulate_once(workloads[w], first_seed + s, options_.simulation, stop);
      });
    });
    std::vector<std::vector<Run>> whole;
    for (const auto &of_workload : runs) {
      std::vector<Run> each;
      for (const std::optional<Run> &run : of_workload) {
        if (!run) return whole;
        each.push_back(*run);
      }
      whole.push_back(std::move(each));
    }
    return whole;
  }

  static RunScore sum(const std::vector<Run> &runs) {
    RunScore score;
    for (const Run &run : runs) {
      for (std::size_t c = 0; c < kCriticalities; ++c) score.of[c].add(run[c]);
    }
    return score;
  }

  // Returns false where no bound applies.
  bool is_proven(const Workload &workload) const {
    analysis::AnalysisPlatform platform = analysis::platform_of(workload);
    platform.release_overhead = options_.simulation.overheads.release;
    platform.dispatch_overhead = options_.simulation.overheads.dispatch;
    platform.preempt_overhead = options_.simulation.overheads.preempt;
    if (options_.machine) {
      platform = analysis::charge(analysis::platform_of(workload), *options_.machine);
    }
    const Result<analysis::TaskSet> task_set = analysis::compile(workload, platform);
    return task_set && analysis::analyze(*task_set).verdict == analysis::Verdict::Schedulable;
  }

  std::vector<RunScore> scores_of(std::span<const Point> points) {
    std::vector<Workload> workloads;
    for (const Point &point : points) workloads.push_back(settings_.apply(point));
    std::vector<RunScore> scores;
    for (const std::vector<Run> &runs : simulate(workloads, options_.seed, options_.seeds, options_.stop)) {
      scores.push_back(sum(runs));
      scores.back().changes = static_cast<std::uint32_t>(settings_.changes(points[scores.size() - 1]));
    }
    if (options_.bounds) {
      arena_.execute([&] {
        tbb::parallel_for(std::size_t{0}, scores.size(), [&](std::size_t i) {
          // A workload with observed misses needs no proof.
          scores[i].proven = scores[i].all().missed == 0 && is_proven(workloads[i]);
        });
      });
    }
    tried_ += scores.size();
    if (options_.progress) options_.progress(tried_);
    return scores;
  }

  void hold_out(Tuned &tuned) {
    tuned.best = tuned.found;
    if (options_.held_out == 0) return;
    std::vector<Workload> workloads = {tuned.present.workload};
    if (tuned.found.point != tuned.present.point) workloads.push_back(tuned.found.workload);
    // Not stoppable: the setting that was found deserves a verdict.
    const auto runs = simulate(workloads, options_.seed + options_.seeds, options_.held_out, nullptr);
    judge(tuned.present, runs.front());
    if (runs.size() > 1) judge(tuned.found, runs.back());
    if (runs.size() == 1) tuned.found = tuned.present;
    const bool holds = !improves(tuned.present.held_out, tuned.found.held_out, options_.goal);
    tuned.best = holds ? tuned.found : tuned.present;
  }

  static void judge(SettingCandidate &candidate, const std::vector<Run> &runs) {
    const auto as_score = [&](const std::vector<Run> &some) {
      RunScore score = sum(some);
      score.proven = candidate.score.proven;
      score.changes = candidate.score.changes;
      return score;
    };
    candidate.held_out = as_score(runs);
    for (const Run &run : runs) candidate.held_out_runs.push_back(as_score({run}));
  }

  const TuneOptions &options_;
  SettingSpace settings_;
  int jobs_;
  tbb::global_control allow_;
  tbb::task_arena arena_;
  std::uint64_t tried_ = 0;
};

}  // namespace

std::optional<Tuned> tune(const Workload &workload, const TuneOptions &options) {
  return Tuner(workload, options).run();
}

}  // namespace redag::lab
