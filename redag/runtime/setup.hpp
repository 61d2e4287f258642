// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Which preemption mode a run can have on this machine, and why. Decides once, before threads exist.
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

/// SCHED_FIFO priorities: jobs have 1 to `top_job`, level 0 the top and the last one for demoted jobs; the release
/// timer is above all of them. The highest priorities are left to the kernel's own threads.
struct PriorityBand {
  int top_job = 0;  // 0: the process has no real-time rights
  int timer = 0;

  /// Levels of jobs that are not demoted.
  [[nodiscard]] std::uint32_t levels() const { return static_cast<std::uint32_t>(std::max(1, top_job - 1)); }
  [[nodiscard]] int of_level(std::uint32_t level) const { return std::max(1, top_job - static_cast<int>(level)); }
};

/// What the process may use; tried, not guessed.
[[nodiscard]] PriorityBand probe_priority_band();

/// `auto` becomes `os` where `band` and the policy allow it, else `cooperative`. Error: `os` was asked for and cannot
/// be.
[[nodiscard]] Result<Mode> resolve_mode(PreemptionMode wanted, PolicyKind policy, const PriorityBand &band);

/// What the scheduler is to be told. `threads`: jobs that can be started at once, with os.
[[nodiscard]] sched::Config make_config(const Mode &mode, std::uint32_t workers, PolicyKind policy,
                                        const PriorityBand &band, std::uint32_t threads);

/// An executor's share of this machine: what it was asked for, as it can be had.
struct Setup {
  Mode mode;
  PriorityBand band;
  sched::Config config;
  std::optional<Throttling> throttling;  // of what runs at SCHED_FIFO with `os`
  std::vector<std::string> warnings;

  /// SCHED_FIFO priority of what must not wait for jobs, the release timer first of all; 0: none. Without `os`, one
  /// above that of the calling thread, which workers that it starts inherit (`chrt -f 10 program`).
  [[nodiscard]] int timer_priority() const;
};

/// What an executor is asked for.
struct SetupRequest {
  PreemptionMode preemption = PreemptionMode::Auto;
  PolicyKind policy = PolicyKind::RateMonotonic;
  Ties ties = Ties::Share;
  std::uint32_t workers = 0;  // 0: one for each of `cpus`
  std::uint32_t threads = 0;  // os: jobs that can be started and unfinished at once; 0: some more than workers
  std::vector<int> cpus{};    // empty: the processors that the process may use
};

/// Error: as resolve_mode().
[[nodiscard]] Result<Setup> set_up(const SetupRequest &request);

/// What a user should know before trusting the figures: too few processors, real-time throttling.
[[nodiscard]] std::vector<std::string> mode_warnings(std::uint32_t workers, std::size_t cpus,
                                                     const std::optional<Throttling> &throttling);

}  // namespace redag::runtime
