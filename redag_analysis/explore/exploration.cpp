// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/explore/exploration.hpp"

#include <algorithm>

#include <fmt/format.h>

#include "redag_analysis/explore/exploration_model.hpp"

namespace redag::analysis {
namespace {

// Splits the response into own execution and waiting. The causes of the wait differ from schedule to schedule.
ResponseBound bound_of(const CompiledTask &task, std::uint32_t t, Duration response) {
  ResponseBound bound;
  bound.response = response;
  bound.terms.push_back(Term{Term::Kind::Own, TaskId(t), DagId(), task.wcet - task.overhead, 1});
  if (task.overhead > 0) bound.terms.push_back(Term{Term::Kind::Overhead, TaskId(t), DagId(), task.overhead, 0});
  if (response > task.wcet) {
    bound.terms.push_back(Term{Term::Kind::Waiting, TaskId(), DagId(), response - task.wcet, 0});
  }
  return bound;
}

std::string_view why_absent(Exploration::End end) {
  switch (end) {
    case Exploration::End::Overrun: return "a job can end after its task's next release, so jobs would be skipped";
    case Exploration::End::GaveUp: return "gave up: too many states";
    case Exploration::End::Stopped: return "the exploration was stopped before it was complete";
    case Exploration::End::Complete: break;
  }
  return {};
}

std::string describe(const TaskSet &task_set, const Exploration &exploration) {
  if (exploration.states == 0) {
    return fmt::format("gave up before the first state: a hyperperiod has {} jobs", exploration.jobs);
  }
  const std::string states = fmt::format("{} states", exploration.states);
  switch (exploration.end) {
    case Exploration::End::Complete:
      return fmt::format("{}, {} jobs per hyperperiod, {}; for the stated offsets", states, exploration.jobs,
                         exploration.exact ? "exact" : "safe, not exact");
    case Exploration::End::Overrun:
      return fmt::format("{}; {} {} end after its next release", states, task_set.tasks[exploration.late.value].name,
                         exploration.exact ? "can" : "is not shown not to");
    case Exploration::End::GaveUp: return "gave up at " + states;
    case Exploration::End::Stopped: return "stopped at " + states;
  }
  return {};
}

}  // namespace

ResponseRange Exploration::of(TaskId task) const {
  ResponseRange all;
  for (const ResponseRange &range : responses[task.value]) {
    all.best = std::min(all.best, range.best);
    all.worst = std::max(all.worst, range.worst);
  }
  return all;
}

std::optional<std::string> why_not_explore(const TaskSet &task_set) {
  if (!task_set.not_analysable.empty()) return task_set.not_analysable;
  if (task_set.has_rate_edges()) return "edges join tasks that are not released together: see the bounds for DAGs";
  const auto is_free = [&](const CompiledTask &task) {
    return task.has_gaps || task.clock != task_set.tasks.front().clock;
  };
  if (std::any_of(task_set.tasks.begin(), task_set.tasks.end(), is_free)) {
    return "nothing states when some tasks are released after others: they have no common clock";
  }
  if (task_set.mode != sched::Preemption::None)
    return "requires jobs that run to completion, but jobs can be preempted here";
  if (task_set.policy == PolicyKind::Fifo) return "under fifo, the order of two jobs depends on when they became ready";
  if (task_set.frozen > 0) return "stalls of the machine can occur at any time";
  const bool has_data =
      std::any_of(task_set.tasks.begin(), task_set.tasks.end(), [](const CompiledTask &task) { return task.data; });
  if (task_set.policy == PolicyKind::Edf && has_data) {
    return "under edf, the deadlines of data tasks depend on when they are released";
  }
  const auto too_late = [](const CompiledTask &task) {
    return task.offset > kLongestExplored || task.jitter > kLongestExplored;
  };
  if (hyperperiod_of(task_set) > kLongestExplored ||
      std::any_of(task_set.tasks.begin(), task_set.tasks.end(), too_late)) {
    return "the hyperperiod, an offset or a jitter is too long";
  }
  return std::nullopt;
}

Bound to_bound(const TaskSet &task_set, const Exploration &exploration) {
  Bound bound;
  bound.figures = describe(task_set, exploration);
  bound.tasks.resize(task_set.tasks.size());
  bound.dags.resize(task_set.dags.size());
  if (exploration.end != Exploration::End::Complete) {
    for (ResponseBound &task : bound.tasks) task.absent = why_absent(exploration.end);
    for (ResponseBound &dag : bound.dags) dag.absent = why_absent(exploration.end);
    return bound;
  }
  for (std::uint32_t t = 0; t < task_set.tasks.size(); ++t) {
    bound.tasks[t] = bound_of(task_set.tasks[t], t, exploration.of(TaskId(t)).worst);
    ResponseBound &dag = bound.dags[task_set.tasks[t].dag.value];
    if (dag.response.value_or(-1) < *bound.tasks[t].response) dag = bound.tasks[t];
  }
  return bound;
}

Method exploration(ExplorationOptions options) {
  return Method{
      .name = "exploration",
      .subject = Subject::Task,
      .cite =
          "M. Nasri, B. Brandenburg, An exact and sustainable analysis of non-preemptive scheduling, RTSS 2017; M. "
          "Nasri, G. Nelissen, B. Brandenburg, Response-time analysis of limited-preemptive parallel DAG tasks under "
          "global scheduling, ECRTS 2019 (docs/analysis.md, \"Exploration\")",
      .assumptions =
          "any number of workers, jobs run to completion, strictly periodic with the stated offsets; the tasks that "
          "edges join have one rate and one offset; R <= T; jitter, bcet, max_active, groups; static priorities, or "
          "edf without data tasks; exact on one worker",
      .complexity = "up to max_states states, O(n) per state",
      .apply = [options = std::move(options)](const TaskSet &task_set) -> Outcome {
        if (auto reason = why_not_explore(task_set)) return NotApplicable{*std::move(reason)};
        return to_bound(task_set, explore(task_set, options));
      },
  };
}

}  // namespace redag::analysis
