// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Figures that span jobs: how many jobs of a DAG are in progress, how busy workers are, and priority inversion.
// Incremental, one pass over the events. Not thread-safe.
#pragma once

#include <cstdint>
#include <deque>
#include <limits>
#include <span>
#include <vector>

#include "redag/derived/clusters.hpp"
#include "redag_analysis/metrics/replay.hpp"

namespace redag::metrics {

/// Times at which an eligible or preempted job waited while one of lower priority ran. Each job counts with its own
/// priority. Neither inheritance nor a lack of threads hides an inversion, and equals have the same priority.
/// Overlapping inversions count as one.
struct Inversions {
  std::uint64_t count = 0;
  Duration total = 0;
  Duration longest = 0;

  friend bool operator==(const Inversions &, const Inversions &) = default;
};

/// Time in HI mode.
struct HighModeTime {
  std::uint64_t count = 0;  // the number of times that it began, or was on at the beginning
  Duration total = 0;

  friend bool operator==(const HighModeTime &, const HighModeTime &) = default;
};

class Activity {
 public:
  /// Measures workers and inversions from `begin` on, and peaks from the first event.
  Activity(const Workload &workload, const sched::Config &config, Time begin);

  void add(std::span<const JobEvent> events);
  /// Closes what is open when the run ends. Call once.
  void finish(Time end);

  /// The most jobs of the DAG that were started and unfinished at any time.
  [[nodiscard]] std::uint32_t peak_active(DagId dag) const { return peaks_[dag.value]; }
  /// The number of jobs that started while another job of their group was started and unfinished.
  [[nodiscard]] std::uint64_t group_overlaps() const { return group_overlaps_; }
  /// The time during which each worker held a job.
  [[nodiscard]] const std::vector<Duration> &busy() const { return busy_; }
  [[nodiscard]] Time last_time() const { return time_; }
  [[nodiscard]] const Inversions &inversions() const { return inversions_; }
  [[nodiscard]] const HighModeTime &high_mode() const { return high_mode_; }

 private:
  /// What one cluster does: no job waits for one of another.
  struct Part {
    Part(const ClusterPart &its_part, const sched::Config &config)
        : cluster(its_part), replay(cluster.workload, config) {}

    const ClusterPart cluster;
    Replay replay;
    Time high_since = kNever;
  };

  void add(const JobEvent &event);
  void end_of_instant();
  [[nodiscard]] static bool is_inverted(const Replay &replay);
  [[nodiscard]] Duration measured(Time from, Time to) const;
  void close_inversion(Time at);
  void close_high_mode(Part &part, Time at);

  std::deque<Part> parts_;         // keeps its elements where they are
  std::vector<TaskPlace> places_;  // by TaskId
  Time begin_;
  Time time_ = std::numeric_limits<Time>::min();
  bool any_ = false;
  Time inverted_since_ = kNever;
  Inversions inversions_;
  HighModeTime high_mode_;
  std::vector<std::uint32_t> peaks_;
  std::uint64_t group_overlaps_ = 0;
  std::vector<Duration> busy_;
  std::vector<Time> busy_since_;
};

}  // namespace redag::metrics
