// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// What `tune` looks for: the score of a setting by its bounds or by simulated runs, and the comparison
// of two scores. Scores of runs are observations, not bounds: other seeds can be worse. Pure, apart from `stop`.
#pragma once

#include <atomic>
#include <cstdint>
#include <optional>

#include "redag/model/workload.hpp"
#include "redag_analysis/core/task_set.hpp"
#include "redag_analysis/sim/simulator.hpp"

namespace redag::lab {

enum class Judge : std::uint8_t {
  Simulation,  // fewest jobs late or lost
  Bounds,      // fewest without a bound, then the most slack
};

/// "simulation" or "bounds".
[[nodiscard]] const char *to_string(Judge judge);

/// The quality of a setting: counts of jobs in simulated runs, or of tasks and DAGs with a deadline by their bounds. An
/// end-to-end deadline counts as the deadline of the jobs that carry the data.
struct Score {
  bool proven = false;          // bounds show that every deadline is met
  std::uint64_t judged = 0;     // jobs released, or deadlines
  std::uint64_t missed = 0;     // lost or late; or not shown to be met
  std::uint64_t lost = 0;       // skipped, or aborted although there was data; or without a bound of all jobs
  std::optional<double> slack;  // the least (deadline - response) / deadline, of jobs or bounds
  std::uint32_t changes = 0;    // number of differences from the present workload

  void see(Duration response, Duration due);
  void add(const Score &run);
  friend bool operator==(const Score &, const Score &) = default;
};

/// Returns the score of a task set by all bounds of analyze(). The deadline counts as sooner where the next release
/// would skip a job that has not started.
[[nodiscard]] Score score_of_bounds(const analysis::TaskSet &task_set);

struct Simulation {
  Duration duration = 10 * kSecond;
  sim::Overheads overheads;
};

/// Returns the score of one simulated run with our scheduler; nothing if `stop` ended it.
[[nodiscard]] std::optional<Score> score_of_run(const Workload &workload, std::uint64_t seed,
                                                const Simulation &simulation, const std::atomic<bool> *stop);

/// A proven setting wins, then the judge's criterion; true justifies a change.
[[nodiscard]] bool improves(const Score &a, const Score &b, Judge judge);
/// As improves(); equals are decided by more slack, then by fewer changes.
[[nodiscard]] bool is_better(const Score &a, const Score &b, Judge judge);

}  // namespace redag::lab
