// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/search/score.hpp"

#include <algorithm>

#include "redag/sched/priority_scheduler.hpp"
#include "redag_analysis/metrics/deadline_watch.hpp"

namespace redag::tune {
namespace {

// Returns less than 0 if `a` is better.
int compare(const ClassScore &a, const ClassScore &b, Objective objective) {
  const auto order = [](auto x, auto y) { return x < y ? -1 : (y < x ? 1 : 0); };
  if (objective == Objective::Misses) return order(a.missed, b.missed);
  if (const int lost = order(a.lost, b.lost); lost != 0) return lost;
  if (objective == Objective::MaxLateness) return order(a.max_lateness, b.max_lateness);
  return order(b.least_slack, a.least_slack);
}

int compare(const Score &a, const Score &b, const Goal &goal) {
  if (a.proven != b.proven) return a.proven ? -1 : 1;
  if (!goal.per_criticality) return compare(a.all(), b.all(), goal.objective);
  for (std::size_t c = kCriticalities; c-- > 0;) {
    if (const int order = compare(a.of[c], b.of[c], goal.objective); order != 0) return order;
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
  const auto see = [&score](Duration response, Duration due) {
    const double slack = static_cast<double>(due - response) / static_cast<double>(due);
    score.max_lateness = score.any ? std::max(score.max_lateness, response - due) : response - due;
    score.least_slack = std::min(score.least_slack, slack);
    score.any = true;
  };
  see(*job.response, deadline);
  if (end_to_end > 0 && job.end_to_end) see(*job.end_to_end, end_to_end);
}

}  // namespace

const char *to_string(Objective objective) {
  switch (objective) {
    case Objective::Misses: return "misses";
    case Objective::MaxLateness: return "max_lateness";
    case Objective::Slack: return "slack";
  }
  return "?";
}

void ClassScore::add(const ClassScore &other) {
  released += other.released;
  missed += other.missed;
  lost += other.lost;
  if (!other.any) return;
  max_lateness = any ? std::max(max_lateness, other.max_lateness) : other.max_lateness;
  least_slack = std::min(least_slack, other.least_slack);
  any = true;
}

ClassScore Score::all() const {
  ClassScore sum;
  for (const ClassScore &each : of) sum.add(each);
  return sum;
}

bool improves(const Score &a, const Score &b, const Goal &goal) { return compare(a, b, goal) < 0; }

bool is_better(const Score &a, const Score &b, const Goal &goal) {
  if (const int order = compare(a, b, goal); order != 0) return order < 0;
  const double slack_a = a.all().least_slack;
  const double slack_b = b.all().least_slack;
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

}  // namespace redag::tune
