// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The executors by name. Drivers and the program get their schedulers here.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string_view>
#include <vector>

#include "redag/derived/clusters.hpp"
#include "redag/sched/scheduler.hpp"

namespace redag::executors {

struct ExecutorKind {
  std::string_view name;         // as the user writes it
  std::string_view description;  // one line
  bool ours = false;             // with priorities, preemption, max_active and budgets, which peers do not know
  bool single_worker = false;    // uses one worker on any platform
  bool keeps_releases = false;   // a timer's release is never skipped for an earlier one that has not run
};

/// All executors, ours first.
[[nodiscard]] std::span<const ExecutorKind> all();

/// Returns nullptr for an unknown name.
[[nodiscard]] const ExecutorKind *find_executor(std::string_view name);

/// The configuration that the executor makes of `config`. A model of another executor has no preemption, levels or
/// bound on threads, and some have one worker.
[[nodiscard]] sched::Config effective_config(const ExecutorKind &kind, sched::Config config);

/// The configuration of a cluster. `whole` is the configuration of the platform. Only the number of workers differs;
/// `levels` and `max_started` are those of each cluster.
[[nodiscard]] inline sched::Config config_of(sched::Config whole, const ClusterPart &part) {
  if (part.is_cluster()) whole.workers = part.workload.platform.workers;
  return whole;
}

/// Creates a scheduler for effective_config(), with clusters one for each of them. Requires a known name and what
/// PriorityScheduler requires. `ranks`: see WaitSetDispatcher; not with clusters.
[[nodiscard]] std::unique_ptr<sched::Scheduler> make_scheduler(std::string_view name, const Workload &workload,
                                                               const sched::Config &config,
                                                               std::vector<std::uint32_t> ranks = {});

}  // namespace redag::executors
