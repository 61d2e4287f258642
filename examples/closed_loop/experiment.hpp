// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Runs one executor with one seed and all plants. A run in virtual time is exact and the same on every machine; a run
// on threads depends on this machine.
#pragma once

#include <atomic>
#include <string>
#include <vector>

#include "plants.hpp"
#include "redag/model/workload.hpp"
#include "redag_analysis/metrics/summary.hpp"

namespace closed_loop {

/// Returns the five plants of robot.yaml.
[[nodiscard]] std::vector<PlantSpec> plants();

struct ExecutorChoice {
  std::string name;      // as written on the command line
  std::string executor;  // a name of redag_analysis/executors/executors.hpp
  redag::PreemptionMode preemption = redag::PreemptionMode::Auto;
  bool alone = false;             // the feedback without other work: the best that any executor can reach
  bool realtime_threads = false;  // on threads: SCHED_FIFO, as redag's threads have with preemption os
};

/// Finds alone, redag, redag-cooperative, redag-none, mte, ste, ..., mte-fifo, ste-fifo, ... by name. Throws
/// std::runtime_error for another name.
[[nodiscard]] ExecutorChoice executor_choice(const std::string &name);

struct Snapshot {
  Time time = 0;
  double position = 0;
  double height = 0;
  double angle = 0;
  bool down = false;
};

struct PlantResult {
  std::string plant;
  double cost = 0;
  std::uint32_t falls = 0;
  std::uint64_t jobs = 0;    // released, of its DAG
  std::uint64_t missed = 0;  // late or lost
  Duration longest_gap = 0;  // between two actuations
  std::vector<Snapshot> snapshots;
};

struct RunSetup {
  Duration duration = 20 * redag::kSecond;
  std::uint64_t seed = 1;
  Duration snapshots_every = 0;             // 0: none
  const std::atomic<bool> *stop = nullptr;  // on threads: ends the run early when set
};

struct RunOutcome {
  std::vector<PlantResult> plants;
  std::string mode;  // the preemption that ran
  std::uint64_t other_jobs = 0;
  std::uint64_t other_missed = 0;
};

[[nodiscard]] RunOutcome run_in_virtual_time(const redag::Workload &workload, const ExecutorChoice &choice,
                                             const RunSetup &setup);
/// The sensors' jobs take the snapshots. Throws std::runtime_error with what the system refused.
[[nodiscard]] RunOutcome run_on_threads(const redag::Workload &workload, const ExecutorChoice &choice,
                                        const RunSetup &setup);

}  // namespace closed_loop
