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
#include "redag/runtime/executor_options.hpp"
#include "redag/runtime/realtime_share.hpp"
#include "redag/sched/scheduler.hpp"

namespace redag::runtime {

/// SCHED_FIFO priorities. Jobs have top_job (level 0) down to 1 (demoted jobs). The release timer is above all of them.
/// The highest priorities are left to the kernel's own threads.
struct PriorityBand {
  int top_job = 0;  // 0: the process has no real-time rights
  int timer = 0;

  /// Number of levels for jobs that are not demoted.
  [[nodiscard]] std::uint32_t levels() const { return static_cast<std::uint32_t>(std::max(1, top_job - 1)); }
  [[nodiscard]] int of_level(std::uint32_t level) const { return std::max(1, top_job - static_cast<int>(level)); }
};

/// Finds the priorities that the process may use, by trying them.
[[nodiscard]] PriorityBand probe_priority_band();

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
  std::optional<Throttling> throttling;  // for threads at SCHED_FIFO with `os`
  std::vector<std::string> warnings;

  /// SCHED_FIFO priority of threads that must not wait for jobs, first of all the release timer; 0: none. Without `os`
  /// it is one above that of the calling thread, which workers inherit (`chrt -f 10 program`).
  [[nodiscard]] int timer_priority() const;
};

/// The options that an executor asks for.
struct SetupRequest {
  PreemptionMode preemption = PreemptionMode::Auto;
  PolicyKind policy = PolicyKind::RateMonotonic;
  Ties ties = Ties::Share;
  std::uint32_t workers = 0;  // 0: one for each of `cpus`
  std::uint32_t threads = 0;  // os: jobs that can be started and unfinished at once; 0: some more than workers
  std::vector<int> cpus{};    // empty: the processors that the process may use
};

/// Returns what this machine can provide. Error: as resolve_mode().
[[nodiscard]] Result<Setup> set_up(const SetupRequest &request);

/// What a user should know before trusting the figures: too few processors, or real-time throttling.
[[nodiscard]] std::vector<std::string> mode_warnings(std::uint32_t workers, std::size_t cpus,
                                                     const std::optional<Throttling> &throttling);

}  // namespace redag::runtime
