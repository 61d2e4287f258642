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

// Returns less than 0 if `a` has more slack. Without a response, nothing is late.
int by_slack(const Score &a, const Score &b) { return order(b.slack.value_or(1), a.slack.value_or(1)); }

// Returns less than 0 if `a` is better.
int compare(const Score &a, const Score &b, Judge judge) {
  if (a.proven != b.proven) return a.proven ? -1 : 1;
  if (judge == Judge::Simulation) return order(a.missed, b.missed);
  const int lost = order(a.lost, b.lost);
  return lost != 0 ? lost : by_slack(a, b);
}

void count(const metrics::JudgedJob &job, Duration deadline, Duration end_to_end, Score &score) {
  ++score.judged;
  if (job.miss != metrics::Miss::None) ++score.missed;
  if (job.miss == metrics::Miss::Lost) ++score.lost;
  // A job in flight before its deadline has an unknown lateness.
  const bool in_flight = job.record.outcome == metrics::JobOutcome::InFlight;
  if (!job.response || (in_flight && job.miss == metrics::Miss::None)) return;
  score.see(*job.response, deadline);
  if (end_to_end > 0 && job.end_to_end) score.see(*job.end_to_end, end_to_end);
}

}  // namespace

const char *to_string(Judge judge) { return judge == Judge::Simulation ? "simulation" : "bounds"; }

void Score::see(Duration response, Duration due) {
  slack = std::min(slack.value_or(1), static_cast<double>(due - response) / static_cast<double>(due));
}

void Score::add(const Score &run) {
  judged += run.judged;
  missed += run.missed;
  lost += run.lost;
  if (run.slack) slack = std::min(slack.value_or(1), *run.slack);
}

Score score_of_bounds(const analysis::TaskSet &task_set) {
  const analysis::Report report = analysis::analyze(task_set);
  Score score;
  score.proven = report.verdict == analysis::Verdict::Schedulable;
  const auto see = [&score](const analysis::Tightest &tightest, Duration due) {
    ++score.judged;
    // A response of the jobs that end says nothing about those that are lost.
    const bool is_bounded = tightest.response && !tightest.bound.of_ended;
    if (!is_bounded || *tightest.response > due) ++score.missed;
    if (!is_bounded) {
      ++score.lost;
    } else {
      score.see(*tightest.response, due);
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

bool improves(const Score &a, const Score &b, Judge judge) { return compare(a, b, judge) < 0; }

bool is_better(const Score &a, const Score &b, Judge judge) {
  if (const int better = compare(a, b, judge); better != 0) return better < 0;
  if (const int slack = by_slack(a, b); slack != 0) return slack < 0;
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
