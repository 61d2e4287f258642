// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/search/score.hpp"

#include <algorithm>

#include "redag/sched/priority_scheduler.hpp"
#include "redag_analysis/analyze/analyze.hpp"
#include "redag_analysis/core/arithmetic.hpp"
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

int compare(const BoundScore &a, const BoundScore &b, Objective objective) {
  if (a.schedulable != b.schedulable) return a.schedulable ? -1 : 1;
  if (const int unbounded = order(a.unbounded, b.unbounded); unbounded != 0) return unbounded;
  return compare(a.extremes, b.extremes, objective);
}

int compare(const ClassScore &a, const ClassScore &b, Objective objective) {
  if (objective == Objective::Misses) return order(a.missed, b.missed);
  if (const int lost = order(a.lost, b.lost); lost != 0) return lost;
  return compare(a.extremes, b.extremes, objective);
}

int compare(const RunScore &a, const RunScore &b, const Goal &goal) {
  if (a.proven != b.proven) return a.proven ? -1 : 1;
  if (!goal.per_criticality) return compare(a.all(), b.all(), goal.objective);
  for (std::size_t c = kCriticalities; c-- > 0;) {
    if (const int better = compare(a.of[c], b.of[c], goal.objective); better != 0) return better;
  }
  return 0;
}

void count(const metrics::JudgedJob &job, Duration deadline, Duration end_to_end, ClassScore &score) {
  ++score.released;
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

BoundScore score_of(const analysis::TaskSet &task_set) {
  const analysis::Report report = analysis::analyze(task_set);
  BoundScore score;
  score.schedulable = report.verdict == analysis::Verdict::Schedulable;
  const auto see = [&score](const analysis::Tightest &tightest, Duration due) {
    if (!tightest.response) {
      ++score.unbounded;
      return;
    }
    score.extremes.see(*tightest.response, due);
    score.total = analysis::add(score.total, *tightest.response);
  };
  for (std::size_t t = 0; t < task_set.tasks.size(); ++t) {
    see(report.tasks[t], std::min(task_set.tasks[t].deadline, task_set.tasks[t].limit));
  }
  for (std::size_t d = 0; d < task_set.dags.size(); ++d) {
    if (task_set.dags[d].deadline > 0) see(report.dags[d], task_set.dags[d].deadline);
  }
  return score;
}

bool improves(const BoundScore &a, const BoundScore &b, Objective objective) { return compare(a, b, objective) < 0; }

bool is_better(const BoundScore &a, const BoundScore &b, Objective objective) {
  const int better = compare(a, b, objective);
  return better != 0 ? better < 0 : a.total < b.total;
}

void ClassScore::add(const ClassScore &other) {
  released += other.released;
  missed += other.missed;
  lost += other.lost;
  extremes.add(other.extremes);
}

ClassScore RunScore::all() const {
  ClassScore sum;
  for (const ClassScore &each : of) sum.add(each);
  return sum;
}

bool improves(const RunScore &a, const RunScore &b, const Goal &goal) { return compare(a, b, goal) < 0; }

bool is_better(const RunScore &a, const RunScore &b, const Goal &goal) {
  if (const int better = compare(a, b, goal); better != 0) return better < 0;
  const double slack_a = a.all().extremes.least_slack;
  const double slack_b = b.all().extremes.least_slack;
  if (slack_a != slack_b) return slack_a > slack_b;
  return a.changes < b.changes;
}

std::optional<std::array<ClassScore, kCriticalities>> simulate_once(const Workload &workload, std::uint64_t seed,
                                                                    const Simulation &simulation,
                                                                    const std::atomic<bool> *stop) {
  const sched::Config config = sched::config_of(workload);
  sched::PriorityScheduler scheduler(workload, config);
  sim::Options options;
  options.horizon = simulation.duration;
  options.seed = seed;
  options.overheads = simulation.overheads;

  const std::vector<TaskRef> tasks = flatten(workload);
  std::array<ClassScore, kCriticalities> scores;
  const auto see = [&](const metrics::JudgedJob &job) {
    const TaskRef &task = tasks[job.record.task.value];
    const Dag &dag = workload.dags[task.dag.value];
    count(job, task.task->deadline, dag.deadline, scores[static_cast<std::size_t>(dag.criticality)]);
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
  return scores;
}

}  // namespace redag::lab
