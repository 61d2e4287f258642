// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Response times of independent tasks under global scheduling on m workers: the fixed points and their methods.
// Responses must stay within the period. Pure functions; the fixed points allocate nothing.
#pragma once

#include <span>

#include "redag_analysis/core/bound.hpp"
#include "redag_analysis/many_workers/global.hpp"

namespace redag::analysis {

namespace global {

/// The work of a sequential task in any window of length x if each job executes within `response` of its release: N C +
/// min(C, x + R - C - N T), N = floor((x + R - C) / T), and never more than x. Bertogna, Cirinei, RTSS 2007, eq. 4.
[[nodiscard]] inline Duration sequential_work(const GlobalUnit &task, Duration x) {
  const Division jobs = divide(std::max<Duration>(0, x + task.response - task.volume), task);
  return jobs.quotient * task.volume + std::min(task.volume, jobs.remainder);
}

/// Where guan_response() may begin for units[k], if it gave the responses of all units before it. What delays a more
/// urgent task also delays this one. The window is no shorter if the other task's wcet is no longer.
[[nodiscard]] Duration start_after(std::span<const GlobalUnit> units, std::size_t k);

/// Each of these sets `response` of units[k], given those of the more urgent units[0 .. k). Returns false above its
/// limit, or after too many steps. Below `start` there is no fixed point.
[[nodiscard]] bool guan_response(std::span<GlobalUnit> units, std::size_t k, std::uint32_t workers, Duration start = 0);
/// `remaining` is the sum of the m largest C - 1 of less urgent tasks.
[[nodiscard]] bool sequential_nonpreemptive_response(std::span<GlobalUnit> units, std::size_t k, std::uint32_t workers,
                                                     Duration remaining, Duration start = 0);
/// Where the next fixed point of the unit may begin when others have larger responses: at its last one.
[[nodiscard]] Duration start_again(const GlobalUnit &unit);

}  // namespace global

/// At most m - 1 tasks carry work into the window. N. Guan, M. Stigge, W. Yi, G. Yu, RTSS 2009. Only for R <= T: its
/// extension to arbitrary deadlines is not safe (J. Huang, J.-J. Chen, RTNS 2015).
[[nodiscard]] Method guan();

/// S = floor((Delta + sum W_i(S + 1)) / m), R = S + C. Proof: docs/analysis.md, "Several workers".
[[nodiscard]] Method sequential_nonpreemptive();

}  // namespace redag::analysis
