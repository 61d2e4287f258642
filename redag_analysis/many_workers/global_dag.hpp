// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Response times of DAGs under global scheduling on m workers, by whole DAGs in order of priority. A DAG's jobs of
// successive releases must not overlap: R <= T. Pure functions; the fixed points allocate nothing.
#pragma once

#include <algorithm>
#include <span>
#include <vector>

#include "redag_analysis/core/bound.hpp"
#include "redag_analysis/many_workers/global.hpp"

namespace redag::analysis {

namespace global {

/// Work of a DAG in any window of length x when each release is done within `response`: the first job of the window
/// executes as late and all others as early as they can, `width` at a time. With width = m that of A. Melani et al.,
/// ECRTS 2015, eq. 9, in exact arithmetic: counted in units of 1 / width. Requires response >= volume / width.
[[nodiscard]] inline Duration dag_work(const GlobalUnit &dag, Duration x) {
  const Division jobs = divide((x + dag.response) * static_cast<Duration>(dag.width) - dag.volume, dag);
  return jobs.quotient * dag.volume + std::min(dag.volume, jobs.remainder);
}

/// Fills in `response` of units[k] given those of units[0 .. k): R = L + floor((vol - L + sum W_j(R)) / m). False:
/// above its limit, or too many steps. `start`: below which there is no fixed point.
[[nodiscard]] bool melani_response(std::span<GlobalUnit> units, std::size_t k, std::uint32_t workers,
                                   Duration start = 0);

/// How a DAG's critical path comes to wait under dag_bounded().
struct Waiting {
  Duration window = 0;          // from its first job's release as seen to its finish
  Duration busy = 0;            // most instants in which it waits, all workers are busy and max_active is not reached
  std::vector<Duration> works;  // of the more urgent, by position; scratch of the fixed point
};

/// The same with max_active, `blocking` by less urgent work, and counting of each DAG only what its width lets it do
/// while the critical path waits. `waiting.works` must hold k values.
[[nodiscard]] bool bounded_response(std::span<GlobalUnit> units, std::size_t k, std::uint32_t workers,
                                    Duration blocking, Waiting &waiting, Duration start = 0);

/// What less urgent jobs that run to completion can execute while units[k]'s critical path waits: the m largest once,
/// and m - 1 each time a job of the DAG ends and its next critical one, or one that max_active held back, finds them
/// started.
[[nodiscard]] Duration blocking_of(const System &system, const std::vector<GlobalUnit> &units, std::size_t k,
                                   std::uint32_t workers);

}  // namespace global

/// Full preemption, no max_active. A. Melani, M. Bertogna, V. Bonifaci, A. Marchetti-Spaccamela, G. Buttazzo, ECRTS
/// 2015; IEEE TC 66(2), 2017 (without conditional nodes).
[[nodiscard]] Method melani();

/// Full preemption, max_active or not: R = L + floor((vol - L) / c + sum W_j(R) / m) with refinements. Proof:
/// docs/analysis.md, "Several workers". Never above melani() where both apply.
[[nodiscard]] Method dag_bounded();

/// Jobs run to completion, max_active or not: dag_bounded() with blocking. A safe form of the limited-preemption bound
/// of M. Serrano, A. Melani, M. Bertogna, E. Quinones, DATE 2016. Proof: ibid.
[[nodiscard]] Method dag_nonpreemptive();

/// dag_bounded() over all other DAGs, for any work-conserving order, with preemption or without. Responses rely on each
/// other: all are bounded or none is. Proof: ibid.
[[nodiscard]] Method dag_any();

}  // namespace redag::analysis
