// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Response times of DAGs under global scheduling on m workers, by whole DAGs in order of priority. A DAG's jobs of
// successive releases must not overlap: R <= T. Pure functions; the fixed points allocate nothing.
#pragma once

#include <algorithm>
#include <span>
#include <vector>

#include "redag_analysis/core/arithmetic.hpp"
#include "redag_analysis/core/bound.hpp"
#include "redag_analysis/many_workers/global.hpp"

namespace redag::analysis {

namespace global {

/// The work of a DAG in any window of length x if each release is done within `response`. The first job of the window
/// executes as late and all others as early as they can, `width` at a time. For width = m this is A. Melani et al.,
/// ECRTS 2015, eq. 9, in exact arithmetic with units of 1 / width. Requires response >= volume / width.
[[nodiscard]] inline Duration dag_work(const GlobalUnit &dag, Duration x) {
  const Division jobs = divide(multiply(add(x, dag.response), static_cast<Duration>(dag.width)) - dag.volume, dag);
  return add(multiply(jobs.quotient, dag.volume), std::min(dag.volume, jobs.remainder));
}

/// How a DAG's critical path waits under dag_bounded().
struct Waiting {
  Duration window = 0;          // from its first job's release as seen to its finish
  Duration busy = 0;            // most instants in which it waits, all workers are busy and max_active is not reached
  std::vector<Duration> works;  // of the more urgent DAGs, by position; scratch of the fixed point
};

/// Sets `response` of units[k], given those of units[0 .. k), with max_active and with `blocking` by less urgent work.
/// Each DAG counts only with what its width lets it do while the critical path waits. Returns false above its limit, or
/// after too many steps. Below `start` there is no fixed point. `waiting.works` must hold k values.
[[nodiscard]] bool bounded_response(std::span<GlobalUnit> units, std::size_t k, std::uint32_t workers,
                                    Duration blocking, Waiting &waiting, Duration start = 0);

/// The time that less urgent jobs that run to completion can execute while units[k]'s critical path waits. The m
/// largest count once. m - 1 count each time a job of the DAG ends, and its next critical job, or one that max_active
/// held back, finds them started.
[[nodiscard]] Duration blocking_of(const TaskSet &task_set, const std::vector<GlobalUnit> &units, std::size_t k,
                                   std::uint32_t workers);

}  // namespace global

/// Full preemption, max_active or not: R = L + floor((vol - L) / c + sum W_j(R) / m) with refinements; after A.
/// Melani, M. Bertogna, V. Bonifaci, A. Marchetti-Spaccamela, G. Buttazzo, ECRTS 2015. For independent tasks it is the
/// bound of M. Bertogna, M. Cirinei, RTSS 2007. Proof: docs/analysis.md, "Several workers".
[[nodiscard]] Method dag_bounded();

/// Jobs run to completion, max_active or not: dag_bounded() with blocking. A safe form of the limited-preemption bound
/// of M. Serrano, A. Melani, M. Bertogna, E. Quinones, DATE 2016. Proof: ibid.
[[nodiscard]] Method dag_nonpreemptive();

/// dag_bounded() over all other DAGs, for any work-conserving order, with preemption or without. The responses rely on
/// each other: all are bounded or none is. Proof: ibid.
[[nodiscard]] Method dag_any();

}  // namespace redag::analysis
