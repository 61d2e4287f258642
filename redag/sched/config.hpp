// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The scheduler's configuration and the counts it keeps for each task. Plain values without threads.
#pragma once

#include <cstdint>

#include "redag/model/workload.hpp"

namespace redag::sched {

/// How a running job can lose its worker.
enum class Preemption : std::uint8_t {
  None,         // a job keeps its worker until it ends
  Cooperative,  // at its own preemption points a job lets a more urgent one run on top of it, on the same worker
  Full,         // a job can be preempted at any time and resumed on any worker
};

/// Returns the preemption that a mode asks of the platform. `Auto` counts as `Os`: a driver that may get less resolves
/// it first.
[[nodiscard]] constexpr Preemption preemption_of(PreemptionMode mode) {
  switch (mode) {
    case PreemptionMode::None: return Preemption::None;
    case PreemptionMode::Cooperative: return Preemption::Cooperative;
    case PreemptionMode::Os:
    case PreemptionMode::Auto: break;
  }
  return Preemption::Full;
}

struct Config {
  std::uint32_t workers = 1;  // m
  Preemption preemption = Preemption::None;
  PolicyKind policy = PolicyKind::RateMonotonic;
  // Full preemption on an operating system: the number of priority levels that it offers (0: as many as needed). If
  // there are fewer levels than tiers, neighbouring tiers share a level. Jobs of one level do not preempt each other.
  std::uint32_t levels = 0;
  // Full preemption on threads: the most jobs that can be started and unfinished at once (0: no bound).
  std::uint32_t max_started = 0;
  // If set, ids, job slots and group positions of removed tasks and DAGs are used again once none of their jobs is in
  // flight. Memory then stays flat while tasks come and go. Traces need the opposite: one id names one task for ever.
  bool reuse_ids = false;
  Ties ties = Ties::Share;
};

/// Returns the config of a scheduler for this workload, on a platform without limits on levels and started jobs.
[[nodiscard]] inline Config config_of(const Workload &workload) {
  Config config;
  config.workers = workload.platform.workers;
  config.preemption = preemption_of(workload.platform.preemption);
  config.policy = workload.policy;
  config.ties = workload.ties;
  return config;
}

/// Counts of one task's jobs: released = finished + skipped + aborted + in flight.
struct Accounting {
  std::uint64_t released = 0;
  std::uint64_t finished = 0;
  std::uint64_t skipped = 0;
  std::uint64_t aborted = 0;
  std::uint64_t deferred = 0;
  std::uint64_t no_data = 0;  // of the aborted ones: jobs that found nothing to do, which are no misses

  /// Jobs that never answer: skipped, or aborted although they had data.
  [[nodiscard]] std::uint64_t lost() const { return skipped + aborted - no_data; }
  /// Deadline misses, given how many finished late. The one definition for counters; that for jobs of a record is
  /// redag_analysis/metrics/miss.hpp (docs/model.md, "What is measured").
  [[nodiscard]] std::uint64_t misses(std::uint64_t late) const { return late + lost(); }
  [[nodiscard]] std::uint64_t in_flight() const { return released - finished - skipped - aborted; }
  friend bool operator==(const Accounting &, const Accounting &) = default;
};

}  // namespace redag::sched
