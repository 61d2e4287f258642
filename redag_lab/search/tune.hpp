// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Better workers, max_active and tie order for a workload: what the simulator shows of each over some seeds, and what
// the bounds prove, judged in the end on seeds that the search has not seen. Parallel (oneTBB); the same answer for
// every number of processors.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "redag/base/result.hpp"
#include "redag/model/overheads.hpp"
#include "redag_lab/search/score.hpp"
#include "redag_lab/search/setting.hpp"

namespace redag::tune {

struct Options {
  Goal goal;
  Freedom freedom;
  Simulation simulation;
  std::optional<Overheads> machine;  // charged to the bounds instead of those that are simulated
  bool bounds = true;                // a workload that is proven to keep its deadlines comes before one that is not
  std::uint32_t seeds = 5;           // simulated for each candidate: seed, seed + 1, ...
  std::uint32_t held_out = 10;       // the seeds after these, for the verdict
  analysis::SearchEffort effort = {1024, 4, 1};
  std::uint64_t seed = 1;
  std::uint32_t jobs = 0;                             // processors; 0: all
  const std::atomic<bool> *stop = nullptr;            // ends the search with the best so far
  std::function<void(std::uint64_t tried)> progress;  // after each batch, from the calling thread
};

struct Candidate {
  analysis::Point point;
  Workload workload;
  Score score;                       // on the seeds of the search
  Score held_out;                    // on the others; equal to a default Score if there are none
  std::vector<Score> held_out_runs;  // each of them
};

struct Tuned {
  Candidate present;
  Candidate found;  // best of the search
  Candidate best;   // `found` if it also holds on the seeds held out, else `present`
  std::map<analysis::Point, Score> trials;
  bool exhaustive = true;
  bool stopped = false;
  bool varies = true;  // execution times or jitter do, so that runs of different seeds differ

  [[nodiscard]] bool changed() const { return best.point != present.point; }
  /// The search found something better that was no better on the seeds held out.
  [[nodiscard]] bool rejected() const { return found.point != present.point && !changed(); }
};

/// Requires a valid workload and a seed at least. Never returns a workload that is worse than `workload` by the goal,
/// on the seeds of the search or on those held out. Nothing if stopped before the workload itself was judged.
[[nodiscard]] std::optional<Tuned> tune(const Workload &workload, const Options &options);

}  // namespace redag::tune
