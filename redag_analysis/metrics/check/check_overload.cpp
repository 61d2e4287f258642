// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/metrics/check/check_overload.hpp"

namespace redag::metrics {
namespace {

Duration executed_until(const LiveJob &job, Time time) {
  return job.executed + (job.state == LiveJob::State::Running ? time - job.on_worker_since : 0);
}

}  // namespace

void OverloadRules::before(const JobEvent &event) {
  const LiveJob *job = context_.replay.find(event.task, event.job);
  switch (event.kind) {
    case JobEventKind::HighMode: high_mode(event, job); break;
    case JobEventKind::LowMode: low_mode(event); break;
    case JobEventKind::Exceeded:
      if (job != nullptr) exceeded(event, *job);
      break;
    case JobEventKind::Finished:
    case JobEventKind::Aborted:
      if (job != nullptr) ended(event, *job);
      break;
    default: break;
  }
}

void OverloadRules::exceeded(const JobEvent &event, const LiveJob &job) {
  const Task &task = context_.replay.task(event.task);
  context_.expect(Rule::Budget, task.budget > 0, event.task, event.job,
                  [] { return std::string("it was reported to use up its budget, but its task has none"); });
  if (context_.info.driver != trace::Driver::Simulator) return;
  context_.expect(Rule::Budget, task.on_budget != OnBudget::Abort, event.task, event.job,
                  [] { return std::string("it continued after its budget, at which it had to be cut off"); });
  check_used(event, job, task.budget, "budget");
}

void OverloadRules::high_mode(const JobEvent &event, const LiveJob *job) {
  cause_ = {event.task, event.job};
  const Task &task = context_.replay.task(event.task);
  const bool can_begin = job != nullptr && job->started() && task.wcet_low > 0;
  context_.expect(Rule::Budget, can_begin && !context_.replay.is_degradable(event.task), event.task, event.job,
                  [] { return std::string("it began HI mode, but is not a started job with a wcet_low"); });
  if (can_begin && context_.info.driver == trace::Driver::Simulator) {
    check_used(event, *job, task.wcet_low, "wcet_low");
  }
}

void OverloadRules::check_used(const JobEvent &event, const LiveJob &job, Duration limit, const char *what) {
  const Duration used = executed_until(job, event.time);
  context_.expect(Rule::Budget, exact() ? used == limit : used >= limit, event.task, event.job, [&] {
    return std::string("it was reported to use its ") + what + " of " + format_duration(limit) + " after " +
           format_duration(used);
  });
}

void OverloadRules::low_mode(const JobEvent &event) {
  context_.expect(Rule::Budget, cause_ == std::pair(event.task, event.job), event.task, event.job,
                  [] { return std::string("HI mode ended in its name, but another job began it"); });
  context_.expect(Rule::Budget, is_idle(), event.task, event.job,
                  [] { return std::string("HI mode ended although a job was ready or started"); });
  context_.expect(Rule::Budget, event.value == context_.replay.high_since(), event.task, event.job,
                  [&] { return "HI mode did not begin at " + format_duration(event.value); });
}

// A job that used a limit must have been told.
void OverloadRules::ended(const JobEvent &event, const LiveJob &job) {
  if (!exact()) return;
  const Task &task = context_.replay.task(event.task);
  const Duration used = executed_until(job, event.value);
  if (task.budget > 0 && task.on_budget != OnBudget::Abort) {
    context_.expect(Rule::Budget, job.exceeded == (used > task.budget), event.task, event.job, [&] {
      return "it ended after " + format_duration(used) + " with a budget of " + format_duration(task.budget) +
             (job.exceeded ? ", but was reported to exceed it" : ", but was not reported to exceed it");
    });
  }
  if (task.wcet_low > 0 && used > task.wcet_low) {
    context_.expect(Rule::Budget, context_.replay.high_mode(), event.task, event.job,
                    [&] { return "it executed for " + format_duration(used) + ", above its wcet_low, in LO mode"; });
  }
}

void OverloadRules::end_of_instant() {
  if (!context_.replay.high_mode()) return;
  context_.expect(Rule::Budget, !is_idle(), TaskId(0), 0,
                  [] { return std::string("HI mode continues although no job is ready or started"); });
}

// While nothing has started, every ready job is eligible.
bool OverloadRules::is_idle() const { return context_.replay.started() == 0 && context_.replay.eligible().empty(); }

}  // namespace redag::metrics
