// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/search/score.hpp"

#include <algorithm>

#include "redag/sched/priority_scheduler.hpp"
#include "redag_analysis/analyze/analyze.hpp"
#include "redag_analysis/metrics/deadline_watch.hpp"

namespace redag::lab {
namespace {

// Returns less than 0 if x is less.
template <class T>
int order(const T &x, const T &y) {
  return x < y ? -1 : (y < x ? 1 : 0);
}

// The comparisons return less than 0 if `a` is better.
int compare(const Extremes &a, const Extremes &b, Objective objective) {
  if (objective == Objective::Lateness) return order(a.worst_lateness, b.worst_lateness);
  return order(b.least_slack, a.least_slack);
}

int compare(const Score &a, const Score &b, Objective objective) {
  if (a.proven != b.proven) return a.proven ? -1 : 1;
  if (objective == Objective::Misses) return order(a.missed, b.missed);
  if (const int lost = order(a.lost, b.lost); lost != 0) return lost;
  return compare(a.extremes, b.extremes, objective);
}

void count(const metrics::JudgedJob &job, Duration deadline, Duration end_to_end, Score &score) {
  ++score.judged;
  if (job.miss != metrics::Miss::None) ++score.missed;
  if (job.miss == metrics::Miss::Lost) ++score.lost;
  // A job in flight before its deadline has an unknown lateness.
  const bool in_flight = job.record.outcome == metrics::JobOutcome::InFlight;
  if (!job.response || (in_flight && job.miss == metrics::Miss::None)) return;
  score.extremes.see(*job.response, deadline);
  if (end_to_end > 0 && job.end_to_end) score.extremes.see(*job.end_to_end, end_to_end);
}

}  // namespace

const char *to_string(Objective objective) {
  switch (objective) {
    case Objective::Misses: return "misses";
    case Objective::Lateness: return "lateness";
    case Objective::Slack: return "slack";
  }
  return "?";
}

void Extremes::see(Duration response, Duration due) {
  const Duration lateness = response - due;
  const double slack = static_cast<double>(due - response) / static_cast<double>(due);
  add({.worst_lateness = lateness, .least_slack = slack, .any = true});
}

void Extremes::add(const Extremes &other) {
  if (!other.any) return;
  worst_lateness = any ? std::max(worst_lateness, other.worst_lateness) : other.worst_lateness;
  least_slack = any ? std::min(least_slack, other.least_slack) : other.least_slack;
  any = true;
}

void Score::add(const Score &run) {
  judged += run.judged;
  missed += run.missed;
  lost += run.lost;
  extremes.add(run.extremes);
}

Score score_of_bounds(const analysis::TaskSet &task_set) {
  const analysis::Report report = analysis::analyze(task_set);
  Score score;
  score.proven = report.verdict == analysis::Verdict::Schedulable;
  const auto see = [&score](const analysis::Tightest &tightest, Duration due) {
    ++score.judged;
    if (!tightest.response || tightest.bound.of_ended || *tightest.response > due) ++score.missed;
    if (!tightest.response) {
      ++score.lost;
    } else {
      score.extremes.see(*tightest.response, due);
    }
  };
  for (std::size_t t = 0; t < task_set.tasks.size(); ++t) {
    see(report.tasks[t], std::min(task_set.tasks[t].deadline, task_set.tasks[t].limit));
  }
  for (std::size_t d = 0; d < task_set.dags.size(); ++d) {
    if (task_set.dags[d].deadline > 0) see(report.dags[d], task_set.dags[d].deadline);
  }
  return score;
}

bool improves(const Score &a, const Score &b, Objective objective) { return compare(a, b, objective) < 0; }

bool is_better(const Score &a, const Score &b, Objective objective) {
  if (const int better = compare(a, b, objective); better != 0) return better < 0;
  if (a.extremes.least_slack != b.extremes.least_slack) return a.extremes.least_slack > b.extremes.least_slack;
  return a.changes < b.changes;
}

std::optional<Score> score_of_run(const Workload &workload, std::uint64_t seed, const Simulation &simulation,
                                  const std::atomic<bool> *stop) {
  const sched::Config config = sched::config_of(workload);
  sched::PriorityScheduler scheduler(workload, config);
  sim::Options options;
  options.horizon = simulation.duration;
  options.seed = seed;
  options.overheads = simulation.overheads;

  const std::vector<TaskRef> tasks = flatten(workload);
  Score score;
  const auto see = [&](const metrics::JudgedJob &job) {
    const TaskRef &task = tasks[job.record.task.value];
    const Dag &dag = workload.dags[task.dag.value];
    count(job, task.task->deadline, dag.deadline, score);
  };
  metrics::DeadlineWatch watch(workload);
  bool stopped = false;
  const sim::Result result =
      sim::simulate(workload, scheduler, config.workers, options, [&](std::span<const JobEvent> events) {
        watch.add(events, see);
        stopped = stop != nullptr && stop->load(std::memory_order_relaxed);
        return !stopped;
      });
  if (stopped) return std::nullopt;
  watch.finish(result.end, see);
  return score;
}

}  // namespace redag::lab
