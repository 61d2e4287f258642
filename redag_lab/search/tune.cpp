// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/search/tune.hpp"

#include <oneapi/tbb/global_control.h>
#include <oneapi/tbb/parallel_for.h>
#include <oneapi/tbb/task_arena.h>

#include <algorithm>
#include <limits>
#include <span>
#include <utility>

#include "redag_analysis/analyze/analyze.hpp"

namespace redag::lab {
namespace {

// The score of a workload that cannot be analysed.
Score worst_score() {
  Score score;
  score.missed = score.lost = std::numeric_limits<std::uint64_t>::max();
  return score;
}

class Tuner {
 public:
  Tuner(const Workload &workload, const TuneOptions &options)
      : options_(options),
        settings_(workload, options.freedom, orders_of(workload)),
        jobs_(options.jobs == 0 ? tbb::this_task_arena::max_concurrency() : static_cast<int>(options.jobs)),
        allow_(tbb::global_control::max_allowed_parallelism, static_cast<std::size_t>(jobs_)),
        arena_(jobs_) {}

  std::optional<Tuned> run() {
    const auto better = [this](const Score &a, const Score &b) { return is_better(a, b, options_.judge); };
    CoordinateSearch search([this](std::span<const Point> points) { return scores_of(points); }, better);
    auto found = search.run(settings_.space(), options_.exhaustive);
    if (found.trials.empty()) return std::nullopt;

    Tuned tuned;
    tuned.present = candidate(settings_.space().starts.front(), found.trials);
    // The workload stays as it is unless the judge prefers another one.
    const bool is_improved = improves(found.score, tuned.present.score, options_.judge);
    tuned.found = is_improved ? candidate(found.best, found.trials) : tuned.present;
    tuned.exhaustive = found.exhaustive;
    tuned.stopped = found.stopped;
    tuned.trials = std::move(found.trials);
    for (const NamedOrder &order : settings_.orders()) tuned.orders.push_back(order.name);
    hold_out(tuned);
    return tuned;
  }

 private:
  SettingCandidate candidate(const Point &point, const std::map<Point, Score> &trials) const {
    return SettingCandidate{point, settings_.apply(point), trials.at(point), {}};
  }

  // Simulates every workload with every seed, on all processors of the arena, and sums the scores of its runs. If
  // stopped, the result holds only the first workloads, each with all its seeds.
  std::vector<Score> simulate(const std::vector<Workload> &workloads, std::uint64_t first_seed, std::uint32_t seeds,
                              const std::atomic<bool> *stop) {
    std::vector<std::vector<std::optional<Score>>> runs(workloads.size(), std::vector<std::optional<Score>>(seeds));
    arena_.execute([&] {
      tbb::parallel_for(std::size_t{0}, workloads.size() * seeds, [&](std::size_t i) {
        const std::size_t w = i / seeds;
        const std::size_t s = i % seeds;
        runs[w][s] = score_of_run(workloads[w], first_seed + s, options_.simulation, stop);
      });
    });
    std::vector<Score> scores;
    for (const auto &of_workload : runs) {
      Score score;
      for (const std::optional<Score> &run : of_workload) {
        if (!run) return scores;
        score.add(*run);
      }
      scores.push_back(score);
    }
    return scores;
  }

  // Orders are the same for every number of workers.
  std::vector<NamedOrder> orders_of(const Workload &workload) const {
    if (!options_.freedom.priorities) return {{"present", workload}};
    return orders_to_try(workload, platform_of(workload));
  }

  [[nodiscard]] bool is_stopped() const {
    return options_.stop != nullptr && options_.stop->load(std::memory_order_relaxed);
  }

  [[nodiscard]] analysis::AnalysisPlatform platform_of(const Workload &workload) const {
    analysis::AnalysisPlatform platform = analysis::platform_of(workload);
    if (options_.machine) return analysis::charge(platform, *options_.machine);
    platform.release_overhead = options_.simulation.overheads.release;
    platform.dispatch_overhead = options_.simulation.overheads.dispatch;
    platform.preempt_overhead = options_.simulation.overheads.preempt;
    return platform;
  }

  // Scores the workloads by their bounds. If stopped, the result holds only the first ones. Where a workload cannot be
  // analysed, nothing is proven.
  std::vector<Score> analyse(const std::vector<Workload> &workloads) {
    std::vector<std::optional<Score>> judged(workloads.size());
    arena_.execute([&] {
      tbb::parallel_for(std::size_t{0}, workloads.size(), [&](std::size_t i) {
        if (is_stopped()) return;
        const Result<analysis::TaskSet> task_set = analysis::compile(workloads[i], platform_of(workloads[i]));
        judged[i] = task_set ? score_of_bounds(*task_set) : worst_score();
      });
    });
    std::vector<Score> scores;
    for (const std::optional<Score> &score : judged) {
      if (!score) break;
      scores.push_back(*score);
    }
    return scores;
  }

  // Scores the workloads by simulations. What misses no deadline there may be proven by the bounds.
  std::vector<Score> simulate_all(const std::vector<Workload> &workloads) {
    std::vector<Score> scores = simulate(workloads, options_.seed, options_.seeds, options_.stop);
    arena_.execute([&] {
      tbb::parallel_for(std::size_t{0}, scores.size(), [&](std::size_t i) {
        if (scores[i].missed > 0) return;
        const Result<analysis::TaskSet> task_set = analysis::compile(workloads[i], platform_of(workloads[i]));
        scores[i].proven = task_set && analysis::is_shown_schedulable(*task_set);
      });
    });
    return scores;
  }

  std::vector<Score> scores_of(std::span<const Point> points) {
    std::vector<Workload> workloads;
    for (const Point &point : points) workloads.push_back(settings_.apply(point));
    std::vector<Score> scores = options_.judge == Judge::Bounds ? analyse(workloads) : simulate_all(workloads);
    for (std::size_t i = 0; i < scores.size(); ++i) {
      scores[i].changes = static_cast<std::uint32_t>(settings_.changes(points[i]));
    }
    tried_ += scores.size();
    if (options_.progress) options_.progress(tried_);
    return scores;
  }

  void hold_out(Tuned &tuned) {
    tuned.best = tuned.found;
    if (options_.held_out == 0 || options_.judge == Judge::Bounds) return;
    std::vector<Workload> workloads = {tuned.present.workload};
    if (tuned.found.point != tuned.present.point) workloads.push_back(tuned.found.workload);
    // Not stoppable: the setting that was found deserves a verdict.
    const std::vector<Score> scores = simulate(workloads, options_.seed + options_.seeds, options_.held_out, nullptr);
    judge(tuned.present, scores.front());
    if (scores.size() > 1) judge(tuned.found, scores.back());
    if (scores.size() == 1) tuned.found = tuned.present;
    const bool holds = !improves(tuned.present.held_out, tuned.found.held_out, options_.judge);
    tuned.best = holds ? tuned.found : tuned.present;
  }

  static void judge(SettingCandidate &candidate, Score score) {
    score.proven = candidate.score.proven;
    score.changes = candidate.score.changes;
    candidate.held_out = score;
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
