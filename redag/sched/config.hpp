// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// What a scheduler is told about its platform, and what it counts for each task. Plain values.
#pragma once

#include <cstdint>

#include "redag/model/workload.hpp"

namespace redag::sched {

/// What the platform can do to a running job.
enum class Preemption : std::uint8_t {
  None,         // a job keeps its worker until it ends
  Cooperative,  // at its own preemption points a job lets a higher-priority one run on top of it, on the same worker
  Full,         // a job can be preempted at any time and resumed on any worker
};

/// What a preemption mode asks of the platform. `Auto` counts as `Os`: a driver that may get less resolves it first.
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
  // Full preemption on an operating system: number of distinct priority levels it has for us (0: as many as it takes).
  // Where priorities outnumber levels, neighbours share one: tasks of one level do not preempt each other.
  std::uint32_t levels = 0;
  // Full preemption on threads: jobs that can be started and unfinished at once (0: no bound).
  std::uint32_t max_started = 0;
  // Ids, job slots and group positions of removed tasks and DAGs are used again once nothing of them is in flight, so
  // that memory stays flat under endless adding and removing. Otherwise an id names one task for ever, as traces need.
  bool reuse_ids = false;
  Ties ties = Ties::Share;
};

/// What a scheduler of this workload is told, on a platform without limits on levels and started jobs.
[[nodiscard]] inline Config config_of(const Workload &workload) {
  Config config;
  config.workers = workload.platform.workers;
  config.preemption = preemption_of(workload.platform.preemption);
  config.policy = workload.policy;
  config.ties = workload.ties;
  return config;
}

/// Jobs of one task: released = finished + skipped + aborted + in flight.
struct Accounting {
  std::uint64_t released = 0;
  std::uint64_t finished = 0;
  std::uint64_t skipped = 0;
  std::uint64_t aborted = 0;
  std::uint64_t deferred = 0;

  [[nodiscard]] std::uint64_t in_flight() const { return released - finished - skipped - aborted; }
  friend bool operator==(const Accounting &, const Accounting &) = default;
};

}  // namespace redag::sched
