// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/analyze/chains.hpp"

#include <numeric>

#include "redag/sched/policy.hpp"
#include "redag_analysis/core/arithmetic.hpp"
#include "redag_analysis/core/rate_edges.hpp"

namespace redag::analysis {
namespace {

bool hands_over(const System &system, TaskId from, TaskId to) {
  const std::vector<std::uint32_t> &before = system.tasks[to.value].predecessors;
  return system.tasks[from.value].unit == system.tasks[to.value].unit &&
         std::find(before.begin(), before.end(), from.value) != before.end();
}

// The response from the unit's release. A task of a larger unit may be bounded only from its own release, but its DAG
// is bounded from the unit's.
const ResponseBound *response_of(const System &system, TaskId task, const Bound &bound) {
  const SystemTask &compiled = system.tasks[task.value];
  const bool single = system.units[compiled.unit].tasks.size() == 1;
  const std::vector<ResponseBound> &responses = single ? bound.tasks : bound.dags;
  const std::uint32_t position = single ? task.value : compiled.dag.value;
  return position < responses.size() && responses[position].response ? &responses[position] : nullptr;
}

// True if a job of `from` that is released no later than one of `to` always ends before that one starts. It must be
// ready when released, only its priority may decide, and no job may run beside it.
bool goes_first(const System &system, const ChainSegment &from, const ChainSegment &to) {
  const SystemTask &producer = system.tasks[from.last.value];
  const SystemTask &consumer = system.tasks[to.first.value];
  const bool alone = from.first == from.last && producer.predecessors.empty();
  return system.platform.workers == 1 && is_static(system.policy) && alone && producer.jitter == 0 &&
         producer.group == kNoGroup && system.dags[producer.dag.value].max_active == 0 &&
         producer.tier < consumer.tier && system.mode != sched::Preemption::Cooperative;
}

Duration one_worker_reaction(const System &system, const std::vector<ChainSegment> &segments) {
  Duration sum = add(segments.front().period, segments.back().response);
  for (std::size_t i = 0; i + 1 < segments.size(); ++i) {
    const ChainSegment &from = segments[i];
    const ChainSegment &to = segments[i + 1];
    const Duration step =
        goes_first(system, from, to) ? std::max(from.response, to.period) : add(to.period, from.response);
    sum = add(sum, step);
  }
  return sum;
}

}  // namespace

std::variant<NotApplicable, ChainBound> chain_bound(const System &system, std::span<const TaskId> chain,
                                                    const Bound &bound) {
  if (chain.empty()) return NotApplicable{"a chain without tasks"};
  if (!system.not_analysable.empty()) return NotApplicable{system.not_analysable};
  if (auto reason = why_not_directly(system)) return NotApplicable{*reason};
  ChainBound result;
  for (std::size_t i = 0; i < chain.size(); ++i) {
    if (i > 0 && hands_over(system, chain[i - 1], chain[i])) {
      result.segments.back().last = chain[i];
      continue;
    }
    const SystemTask &task = system.tasks[chain[i].value];
    const ResponseBound *response = response_of(system, chain[i], bound);
    if (response == nullptr) return NotApplicable{"task '" + task.name + "' has no response bound"};
    if (*response->response > task.period) {
      return NotApplicable{"task '" + task.name + "': a response above its period can hold data back for longer"};
    }
    result.segments.push_back(ChainSegment{chain[i], chain[i], task.period, *response->response});
  }
  for (const ChainSegment &segment : result.segments) {
    result.sum = add(result.sum, add(segment.period, segment.response));
  }
  if (system.platform.workers == 1) result.one_worker = one_worker_reaction(system, result.segments);
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
