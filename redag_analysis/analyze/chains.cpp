// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/analyze/chains.hpp"

#include <algorithm>
#include <numeric>

#include "redag/sched/policy.hpp"
#include "redag_analysis/core/arithmetic.hpp"
#include "redag_analysis/core/rate_edges.hpp"

namespace redag::analysis {
namespace {

// True if only the hop of its bound says how often the task hands data over: it or its unit waits for data of other
// rates, or its DAG is bounded from the origin of such data.
bool needs_hop(const TaskSet &task_set, const CompiledTask &task) {
  const auto waits = [&](std::uint32_t u) { return !task_set.units[u].awaits.empty(); };
  const std::vector<std::uint32_t> &units = task_set.dags[task.dag.value].units;
  return waits(task.unit) ||
         (task_set.units[task.unit].tasks.size() > 1 && std::any_of(units.begin(), units.end(), waits));
}

bool hands_over(const TaskSet &task_set, TaskId from, TaskId to) {
  const std::vector<std::uint32_t> &before = task_set.tasks[to.value].predecessors;
  return task_set.tasks[from.value].unit == task_set.tasks[to.value].unit &&
         std::find(before.begin(), before.end(), from.value) != before.end();
}

// The bound from the unit's release. A task of a larger unit may be bounded only from its own release, but its DAG is
// bounded from the unit's. In a DAG with edges between rates, the task's own bound states its hop.
const ResponseBound *bound_of(const TaskSet &task_set, TaskId task, const Bound &bound) {
  const CompiledTask &compiled = task_set.tasks[task.value];
  const bool single = task_set.units[compiled.unit].tasks.size() == 1;
  const bool states_hop = task.value < bound.tasks.size() && bound.tasks[task.value].hop;
  const std::vector<ResponseBound> &responses = single || states_hop ? bound.tasks : bound.dags;
  const std::uint32_t position = single || states_hop ? task.value : compiled.dag.value;
  const bool is_known = position < responses.size() && responses[position].response && !responses[position].of_ended;
  return is_known ? &responses[position] : nullptr;
}

// True if a job of `from` that is released no later than one of `to` always ends before that one starts. It must be
// ready when released, only its priority may decide, no job may run beside it, and it must not leave the worker. The
// consumer must read on its own grid.
bool goes_first(const TaskSet &task_set, const ChainSegment &from, const ChainSegment &to) {
  const CompiledTask &producer = task_set.tasks[from.last.value];
  const CompiledTask &consumer = task_set.tasks[to.first.value];
  const bool alone = from.first == from.last && producer.predecessors.empty();
  return task_set.platform.workers == 1 && is_static(task_set.policy) && alone && producer.jitter == 0 &&
         producer.group == kNoGroup && producer.wake_ups == 0 && task_set.dags[producer.dag.value].max_active == 0 &&
         producer.tier < consumer.tier && task_set.mode != sched::Preemption::Cooperative &&
         task_set.units[consumer.unit].awaits.empty();
}

Duration one_worker_reaction(const TaskSet &task_set, const ChainBound &chain) {
  Duration saved = 0;  // max(R, T') instead of R + T', for each producer that goes first
  for (std::size_t i = 0; i + 1 < chain.segments.size(); ++i) {
    const ChainSegment &from = chain.segments[i];
    const ChainSegment &to = chain.segments[i + 1];
    if (goes_first(task_set, from, to)) saved += std::min(from.response, to.period);
  }
  return chain.sum - saved;
}

}  // namespace

std::variant<NotApplicable, ChainBound> chain_bound(const TaskSet &task_set, std::span<const TaskId> chain,
                                                    const Bound &bound) {
  if (chain.empty()) return NotApplicable{"the chain has no tasks"};
  if (!task_set.not_analysable.empty() && !task_set.has_waits) return NotApplicable{task_set.not_analysable};
  if (!task_set.has_rate_edges()) {
    if (auto reason = why_not_directly(task_set)) return NotApplicable{*reason};
  } else if (task_set.threads_suffice_if_bounded) {
    return NotApplicable{"there are fewer threads than tasks, and edges join tasks of different periods or offsets"};
  }
  ChainBound result;
  for (std::size_t i = 0; i < chain.size(); ++i) {
    const CompiledTask &task = task_set.tasks[chain[i].value];
    const bool continues = i > 0 && hands_over(task_set, chain[i - 1], chain[i]);
    const ResponseBound *response = bound_of(task_set, chain[i], bound);
    if (task.has_gaps) {
      return NotApplicable{"task '" + task.name +
                           "' is released by events, and nothing bounds the time until the next"};
    }
    if (response == nullptr) return NotApplicable{"task '" + task.name + "' has no response bound"};
    if (*response->response > task.period) {
      return NotApplicable{"task '" + task.name +
                           "': its response time can exceed its period, which can hold data back for longer"};
    }
    if (needs_hop(task_set, task) && !response->hop) {
      return NotApplicable{"task '" + task.name + "' waits for data, and nothing bounds the time until the next"};
    }
    if (!continues) result.segments.push_back({chain[i], chain[i], task.period, 0, 0});
    ChainSegment &segment = result.segments.back();
    segment.last = chain[i];
    segment.response = *response->response;
    segment.hop = response->hop.value_or(add(segment.period, segment.response));
  }
  for (const ChainSegment &segment : result.segments) result.sum = add(result.sum, segment.hop);
  if (task_set.platform.workers == 1) result.one_worker = one_worker_reaction(task_set, result);
  return result;
}

std::optional<Duration> let_reaction(std::span<const LetTask> chain, std::int64_t most_jobs) {
  if (chain.empty()) return std::nullopt;
  Int128 hyperperiod = 1;
  Duration latest = 0;
  const LetTask &first = chain.front();
  for (const LetTask &task : chain) {
    const auto known = static_cast<Duration>(hyperperiod);
    hyperperiod = hyperperiod / std::gcd(known, task.period) * task.period;
    if (hyperperiod > Int128{most_jobs} * first.period || hyperperiod > kMaxDuration) return std::nullopt;
    latest = std::max(latest, task.offset);
  }

  const auto at_or_after = [](const LetTask &task, Time time) {
    return task.offset + ceil_div(std::max<Duration>(0, time - task.offset), task.period) * task.period;
  };
  Duration longest = 0;
  const Time begin = at_or_after(first, latest);
  for (Time read = begin; read < begin + static_cast<Duration>(hyperperiod); read += first.period) {
    // The input comes right after `read`; the next job of the first task sees it.
    Time written = read + first.period + first.deadline;
    for (const LetTask &task : chain.subspan(1)) written = at_or_after(task, written) + task.deadline;
    longest = std::max(longest, written - read);
  }
  return longest;
}

}  // namespace redag::analysis
