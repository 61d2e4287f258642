// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/core/bound.hpp"

#include <algorithm>
#include <utility>

#include "redag_analysis/core/arithmetic.hpp"

namespace redag::analysis {

Duration ResponseBound::sum(Term::Kind kind) const {
  Duration total = 0;
  for (const Term &term : terms) total += term.kind == kind ? term.amount : 0;
  return total;
}

const char *to_string(Subject subject) {
  switch (subject) {
    case Subject::Task: return "task";
    case Subject::Dag: return "dag";
    case Subject::TaskSet: return "system";
  }
  return "?";
}

const char *to_string(Term::Kind kind) {
  switch (kind) {
    case Term::Kind::Own: return "own";
    case Term::Kind::Earlier: return "earlier";
    case Term::Kind::Blocking: return "blocking";
    case Term::Kind::Interference: return "interference";
    case Term::Kind::Jitter: return "jitter";
    case Term::Kind::Wait: return "wait";
    case Term::Kind::Suspended: return "suspended";
    case Term::Kind::Overhead: return "overhead";
  }
  return "?";
}

bool meets_deadline(const CompiledTask &task, const ResponseBound &bound) {
  return bound.response && !bound.of_ended && *bound.response <= std::min(task.deadline, task.limit);
}

Verdict verdict(const TaskSet &task_set, const Bound &bound) {
  if (bound.accepts) return *bound.accepts ? Verdict::Schedulable : Verdict::NotShown;
  if (bound.tasks.size() != task_set.tasks.size()) return Verdict::NotShown;
  for (std::size_t t = 0; t < task_set.tasks.size(); ++t) {
    if (!meets_deadline(task_set.tasks[t], bound.tasks[t])) return Verdict::NotShown;
  }
  for (std::size_t d = 0; d < task_set.dags.size(); ++d) {
    const Duration deadline = task_set.dags[d].deadline;
    if (deadline == 0) continue;
    if (d >= bound.dags.size() || bound.dags[d].response.value_or(kNever) > deadline) return Verdict::NotShown;
  }
  return Verdict::Schedulable;
}

ResponseBound if_bounded(ResponseBound bound) {
  if (bound.response.value_or(0) < kUnbounded) return bound;
  ResponseBound none;
  none.absent = "longer than any representable time";
  return none;
}

Bound from_units(const TaskSet &task_set, std::vector<ResponseBound> units) {
  for (ResponseBound &unit : units) unit = if_bounded(std::move(unit));
  Bound bound;
  bound.tasks.resize(task_set.tasks.size());
  bound.dags.resize(task_set.dags.size());
  for (std::size_t d = 0; d < task_set.dags.size(); ++d) {
    const std::vector<std::uint32_t> &own = task_set.dags[d].units;
    if (own.empty()) continue;
    // The DAG takes the bound of the unit that ends last. If any unit has no bound, neither has the DAG.
    const auto last = *std::max_element(own.begin(), own.end(), [&](std::uint32_t a, std::uint32_t b) {
      return units[a].response.value_or(kNever) < units[b].response.value_or(kNever);
    });
    bound.dags[d] = units[last];
  }
  for (std::size_t t = 0; t < task_set.tasks.size(); ++t) {
    const std::uint32_t unit = task_set.tasks[t].unit;
    const bool only = task_set.units[unit].tasks.size() == 1;
    bound.tasks[t] = only ? std::move(units[unit]) : units[unit];
  }
  return bound;
}

Bound from_tasks(const TaskSet &task_set, std::vector<ResponseBound> tasks) {
  Bound bound;
  for (ResponseBound &task : tasks) bound.tasks.push_back(if_bounded(std::move(task)));
  for (const CompiledDag &dag : task_set.dags) {
    const auto last = std::max_element(dag.tasks.begin(), dag.tasks.end(), [&](std::uint32_t a, std::uint32_t b) {
      return bound.tasks[a].response.value_or(kNever) < bound.tasks[b].response.value_or(kNever);
    });
    bound.dags.push_back(last == dag.tasks.end() ? ResponseBound{} : bound.tasks[*last]);
  }
  return bound;
}

}  // namespace redag::analysis
