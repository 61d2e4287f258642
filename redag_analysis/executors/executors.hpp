// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The executors by name: the one place where drivers and the program get schedulers from.
#pragma once

#include <memory>
#include <span>
#include <string_view>

#include "redag/sched/scheduler.hpp"

namespace redag::sched {

struct ExecutorKind {
  std::string_view name;         // what a user writes
  std::string_view description;  // one line
  bool ours = false;             // priorities, preemption, max_active, budgets: what peers do not know
  bool single_worker = false;    // uses one worker, whatever the platform has
  bool keeps_releases = false;   // a timer's release is never skipped for an earlier one that has not run
};

/// All of them, ours first.
[[nodiscard]] std::span<const ExecutorKind> executors();

/// nullptr for an unknown name.
[[nodiscard]] const ExecutorKind *find_executor(std::string_view name);

/// The configuration that the executor makes of `config`: a model of another executor has no preemption, levels or
/// bound on threads, and some have one worker.
[[nodiscard]] Config effective_config(const ExecutorKind &kind, Config config);

/// A scheduler for effective_config(). Requires a known name and what PriorityScheduler requires.
[[nodiscard]] std::unique_ptr<Scheduler> make_scheduler(std::string_view name, const Workload &workload,
                                                        const Config &config);

}  // namespace redag::sched
