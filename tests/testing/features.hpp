// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The features of a workload and its scheduler that tests have to try together, and a count of the pairs that they have
// tried. Plain values.
#pragma once

#include <array>
#include <bitset>
#include <cstdint>
#include <string>
#include <vector>

#include "redag/model/workload.hpp"
#include "redag/sched/config.hpp"

namespace redag::testing {

// Cooperative has preemption points; SharedLevels: fewer levels than tasks; ThreadLimit: max_started; AlignedEdges are
// between timers, RateEdges between rates; Overlap: concurrency; Degraded: skip or stretch, where there is a HI mode;
// Waits are without a device.
// clang-format off
enum class Feature : std::uint8_t {
  SeveralWorkers, Cooperative, FullPreemption, SharedLevels, ThreadLimit, DeadlineMonotonic, FixedPriorities,
  ChainAware, Edf, Fifo, FixedTies, DataEdges, Joins, AlignedEdges, RateEdges, SeveralRates, Offsets, Jitter,
  FreeTimers, Events, VaryingExecution, ShortDeadlines, EndToEndDeadlines, Queues, Overlap, Groups, GroupsAcrossDags,
  MaxActive, MaxPending, CutOff, BudgetsThatGoOn, HighMode, Degraded, Waits, PriorityDevices, FifoDevices, Clusters
};
// clang-format on
inline constexpr std::size_t kFeatures = 37;

using FeatureSet = std::bitset<kFeatures>;

[[nodiscard]] const char *to_string(Feature feature);
[[nodiscard]] FeatureSet features_of(const Workload &workload, const sched::Config &config);

/// Why no run has both; null: one can.
[[nodiscard]] const char *why_never_together(Feature a, Feature b);

class FeaturePairs {
 public:
  void add(const FeatureSet &features);

  /// Calls `visit(a, b, runs)` for each pair that a run can have, also for a feature alone (a == b).
  template <class Visit>
  void visit(Visit visit) const {
    for (std::size_t a = 0; a < kFeatures; ++a) {
      for (std::size_t b = a; b < kFeatures; ++b) {
        if (why_never_together(Feature(a), Feature(b)) == nullptr) visit(Feature(a), Feature(b), runs_[a][b]);
      }
    }
  }

  /// How many pairs occurred, and the rarest of those: "613 pairs, the rarest in 4 runs (clusters with fifo)".
  [[nodiscard]] std::string to_string() const;

 private:
  std::array<std::array<std::uint32_t, kFeatures>, kFeatures> runs_{};
};

}  // namespace redag::testing
