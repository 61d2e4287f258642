// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Checks what a bound assumes of a run on threads: executions within the wcet (as processor time), releases on time,
// and a platform that takes no more than was charged. Only this file decides what is an alarm and what is the noise of
// the machine. Pure but for the file of a run.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "redag/derived/overheads.hpp"
#include "redag/trace/recording.hpp"
#include "redag/trace/trace.hpp"
#include "redag_analysis/metrics/duration_sketch.hpp"

namespace redag::metrics {

/// The executions of a task compared with its wcet.
struct ExecutionCheck {
  std::uint64_t jobs = 0;   // jobs whose processor time is known
  std::uint64_t above = 0;  // jobs above the wcet by more than reading the clock explains
  Duration longest = 0;
  bool is_exceeded = false;  // further above, or more often, than the machine's noise explains
};

/// The assumption that broke, as far as the run shows it.
enum class Broken : std::uint8_t {
  Nothing,   // no broken assumption was seen
  Wcet,      // `task` used `amount` of processor time
  Release,   // a release came `amount` late
  Platform,  // the platform took processors from jobs that held them, for `amount` in all
};

struct ResponseCheck {
  Duration bound = 0;               // 0: none
  std::uint64_t exceeded = 0;       // number of responses above the bound
  Duration worst = 0;               // the largest of these
  Broken broken = Broken::Nothing;  // the cause of the worst one
  TaskId task;
  Duration amount = 0;
  bool is_alarm = false;  // false: the excess is within what an uncalibrated machine may take
};

struct TaskCheck {
  TaskId task;
  ExecutionCheck execution;
  ResponseCheck response;
};

struct AssumptionCheck {
  bool is_calibrated = false;  // the bounds include the costs of the machine
  Overheads allowed;           // the calibrated overheads, or plausible_overheads()
  std::uint32_t workers = 1;
  std::vector<TaskCheck> tasks;  // by TaskId

  [[nodiscard]] bool has_alarms() const;
  /// The excess over a bound that is not yet worth an alarm; 0 where the machine's overheads were charged.
  [[nodiscard]] Duration unalarming(Duration response) const;
  /// Merges another run of the same workload: adds the counts, and keeps the worst of everything else.
  void add(const AssumptionCheck &other);
};

/// The bound on a task's response time, from its nominal release; 0: no bound.
using BoundOf = std::function<Duration(TaskId)>;

/// Checks all jobs that finished, including those of the warm-up. `run.overheads` says whether the bounds are
/// calibrated.
[[nodiscard]] AssumptionCheck check_assumptions(const trace::RunInfo &run, std::span<const JobEvent> events,
                                                const BoundOf &bound_of);

/// The same in two passes over a recorded run, in memory that does not grow with it. Error: a damaged file.
[[nodiscard]] Result<AssumptionCheck> check_assumptions(const trace::Recording &run, const BoundOf &bound_of);

/// True if `excess` is more than a machine with this noise explains. `excess` holds the times above the wcet among
/// `jobs` executions. By Markov's inequality, at most a share E/x of all executions meets noise of x or more, where E
/// is the noise expected in one.
[[nodiscard]] bool is_beyond_noise(const DurationSketch &excess, std::uint64_t jobs, Duration wcet, const Loss &noise);

/// What a Histogram knows of a task's executions, as processor time.
struct ExecutionPercentiles {
  std::uint64_t jobs = 0;
  Duration p50 = 0;
  Duration p99 = 0;
  Duration longest = 0;
};

/// The same test for executions that are not kept one by one. `calibrated`: if empty, plausible_overheads().
[[nodiscard]] bool is_beyond_noise(const ExecutionPercentiles &executions, Duration wcet,
                                   const std::optional<Overheads> &calibrated);

struct Remark {
  bool is_alarm = false;
  TaskId task;
  std::string text;  // "control.imu: ...", without a period
};

/// Returns the remarks to show, alarms first.
[[nodiscard]] std::vector<Remark> remarks(const AssumptionCheck &check, const Workload &workload);

/// Says what the user should add to bounds that do not include the machine's costs.
[[nodiscard]] const char *not_calibrated_hint();

}  // namespace redag::metrics
