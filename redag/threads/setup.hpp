// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Decides which preemption mode a run can have on this machine, and why. Runs once, before threads exist.
#pragma once

#include <algorithm>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "redag/base/result.hpp"
#include "redag/model/workload.hpp"
#include "redag/sched/scheduler.hpp"
#include "redag/threads/threads.hpp"
#include "redag/threads/values.hpp"

namespace redag::runtime {

/// SCHED_FIFO priorities. Jobs have top_job (level 0) down to 1 (demoted jobs). The release timer is above all of them.
/// The highest priorities are left to the kernel's own threads.
struct PriorityBand {
  int top_job = 0;  // 0: the process has no real-time rights
  int timer = 0;
  // By level: priorities in an order of several processes. Empty: all of them, one for each level.
  std::vector<int> given = {};
  bool shared = false;  // jobs of other processes have priorities among these

  /// Number of levels for jobs that are not demoted.
  [[nodiscard]] std::uint32_t levels() const {
    return given.empty() ? static_cast<std::uint32_t>(std::max(1, top_job - 1))
                         : static_cast<std::uint32_t>(given.size());
  }
  [[nodiscard]] int of_level(std::uint32_t level) const {
    if (given.empty()) return std::max(1, top_job - static_cast<int>(level));
    return level < given.size() ? given[level] : 1;
  }
  /// Of the threads that release jobs. Where jobs of other processes can be more urgent than all of the executor's own,
  /// it is just above the own ones, so that its releases do not delay those others.
  [[nodiscard]] int of_releases() const;
};

/// The highest priority that an executor uses. Those above are left to the kernel's own threads.
inline constexpr int kHighestPriority = 90;

/// The band of a process that may use SCHED_FIFO up to this priority.
[[nodiscard]] PriorityBand band_up_to(int limit);

/// Finds the priorities that the process may use, by trying them.
[[nodiscard]] PriorityBand probe_priority_band();

/// The variable that lets the executors of a process share one order with those of other processes (docs/robot.md):
/// `1`, `0`, or the folder of their pages.
inline constexpr const char *kShareOrderVariable = "REDAG_SHARE_ORDER";

/// Returns the folder of the pages of executors that share an order, for a value of REDAG_SHARE_ORDER; null: not set.
/// Empty: no order is shared. Error: the value is none of those that the variable can have.
[[nodiscard]] Result<std::string> order_folder(bool wanted, const char *value);

/// `auto` becomes `os` where `band` and the policy allow it, else `cooperative`. Error: `os` was asked for and is not
/// available.
[[nodiscard]] Result<Mode> resolve_mode(PreemptionMode wanted, PolicyKind policy, const PriorityBand &band);

/// Returns the scheduler's configuration. `threads`: jobs that can be started and unfinished at once, with os.
[[nodiscard]] sched::Config make_config(const Mode &mode, std::uint32_t workers, PolicyKind policy,
                                        const PriorityBand &band, std::uint32_t threads);

/// An executor's options as this machine can provide them.
struct Setup {
  Mode mode;
  PriorityBand band;
  sched::Config config;
  std::uint32_t spare_threads = 0;  // none, cooperative: threads of jobs that block (redag::Blocking)
  std::string order_folder;         // see EngineOptions
  std::vector<std::string> warnings;
  std::string missing_processors;  // the warning that there are fewer than workers; "": there are enough

  /// SCHED_FIFO priority of threads that must not wait for jobs, first of all the release timer; 0: none. Without `os`
  /// it is one above that of the calling thread, which workers inherit (`chrt -f 10 program`).
  [[nodiscard]] int timer_priority() const;
  /// SCHED_FIFO priority of the most urgent jobs; 0: none. Without `os` it is that of the calling thread.
  [[nodiscard]] int top_job_priority() const;
};

/// The options that an executor asks for.
struct SetupRequest {
  PreemptionMode preemption = PreemptionMode::Auto;
  PolicyKind policy = PolicyKind::RateMonotonic;
  Ties ties = Ties::Share;
  std::uint32_t workers = 0;  // 0: one for each of `cpus`
  std::uint32_t threads = 0;  // jobs that can be started and unfinished at once; 0: os some more than workers
  std::vector<int> cpus{};    // empty: the processors that the process may use
  bool share_order = false;   // see ExecutorOptions
};

/// Returns what this machine can provide. Error: as resolve_mode().
[[nodiscard]] Result<Setup> set_up(const SetupRequest &request);

/// Returns the warning that the workers have to share processors; "": they have one each.
[[nodiscard]] std::string missing_processors(std::uint32_t workers, std::size_t cpus);

}  // namespace redag::runtime
