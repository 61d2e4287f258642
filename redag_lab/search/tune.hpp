// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Finds better workers, priorities and max_active for a workload. Settings are judged by the bounds alone,
// or by simulations with several seeds. Then those that the bounds prove come first, and the winner is validated on
// unseen seeds. Parallel (oneTBB); the result is the same for every number of processors.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "redag/base/result.hpp"
#include "redag/derived/overheads.hpp"
#include "redag_lab/search/score.hpp"
#include "redag_lab/search/setting.hpp"

namespace redag::lab {

struct TuneOptions {
  Judge judge = Judge::Simulation;
  Freedom freedom;
  Simulation simulation;
  std::optional<Overheads> machine;  // charged to the bounds instead of the simulated overheads
  std::uint32_t seeds = 5;           // simulated for each setting: seed, seed + 1, ...
  std::uint32_t held_out = 10;       // the number of unseen seeds after these, for the verdict
  std::uint64_t exhaustive = 1024;   // spaces of at most this many settings are tried completely
  std::uint64_t seed = 1;
  std::uint32_t jobs = 0;                             // processors; 0: all
  const std::atomic<bool> *stop = nullptr;            // ends the search with the best so far
  std::function<void(std::uint64_t tried)> progress;  // called after each batch, on the calling thread
};

struct SettingCandidate {
  Point point;
  Workload workload;
  Score score;     // by the bounds, or on the seeds of the search
  Score held_out;  // on the unseen seeds; a default Score if there are none
};

struct Tuned {
  SettingCandidate present;
  SettingCandidate found;  // best of the search
  SettingCandidate best;   // `found` if it also holds on the unseen seeds, else `present`
  std::map<Point, Score> trials;
  std::vector<std::string> orders;  // names, by the number in a point
  bool exhaustive = true;
  bool stopped = false;

  [[nodiscard]] bool changed() const { return best.point != present.point; }
  /// True if the search found a better setting that was no better on the unseen seeds.
  [[nodiscard]] bool rejected() const { return found.point != present.point && !changed(); }
};

/// Tunes a workload. Requires a valid workload, and at least one seed for simulations. The result is never worse than
/// `workload` for the judge, neither on the seeds of the search nor on the unseen ones. Returns nothing if stopped
/// before `workload` itself was judged.
[[nodiscard]] std::optional<Tuned> tune(const Workload &workload, const TuneOptions &options);

}  // namespace redag::lab
