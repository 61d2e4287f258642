// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// What a bound assumes of a run on threads, against what the run was: executions within the wcet (as processor time),
// releases on time, a platform that takes no more than was charged. The one place that decides what is an alarm and
// what is the noise of the machine. Pure functions.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "redag/model/overheads.hpp"
#include "redag/trace/trace.hpp"
#include "redag_analysis/metrics/jobs.hpp"

namespace redag::metrics {

/// Executions of a task against its wcet.
struct ExecutionCheck {
  std::uint64_t jobs = 0;   // whose processor time is known
  std::uint64_t above = 0;  // by more than reading the clock explains
  Duration longest = 0;
  bool is_exceeded = false;  // further or more often than the machine's noise explains
};

/// Which assumption broke, as far as that can be told.
enum class Broken : std::uint8_t {
  Nothing,   // that was seen
  Wcet,      // of `task`, which used `amount` of processor time
  Release,   // came `amount` late
  Platform,  // took processors from jobs that held them, for `amount` in all
};

struct ResponseCheck {
  Duration bound = 0;               // 0: none
  std::uint64_t exceeded = 0;       // responses above it
  Duration worst = 0;               // of these
  Broken broken = Broken::Nothing;  // behind the worst
  TaskId task;
  Duration amount = 0;
  bool is_alarm = false;  // false: less than a machine that was not calibrated may take
};

struct TaskCheck {
  TaskId task;
  ExecutionCheck execution;
  ResponseCheck response;
};

struct AssumptionCheck {
  bool is_calibrated = false;  // the bounds count what the machine costs
  Overheads allowed;           // calibrated, or plausible_overheads()
  std::uint32_t workers = 1;
  std::vector<TaskCheck> tasks;  // by TaskId

  [[nodiscard]] bool has_alarms() const;
  /// What a machine may add to a response before it is worth an alarm: nothing where its overheads were charged.
  [[nodiscard]] Duration unalarming(Duration response) const;
  /// Another run of the same workload: counts are added, of the rest the worst is kept.
  void add(const AssumptionCheck &other);
};

/// The bound on a task's response time, from its nominal release; 0: none.
using BoundOf = std::function<Duration(TaskId)>;

/// Of all jobs that finished, those of the warm-up included. `run.overheads` says whether the bounds are calibrated.
[[nodiscard]] AssumptionCheck check_assumptions(const trace::RunInfo &run, std::span<const JobEvent> events,
                                                const BoundOf &bound_of);

/// The same by their parts, for who has them otherwise.
[[nodiscard]] AssumptionCheck check_assumptions(const Workload &workload, std::uint32_t workers,
                                                const std::optional<Overheads> &calibrated,
                                                std::span<const JobRecord> jobs, const BoundOf &bound_of);

/// Are `excess` (times above the wcet, of `jobs` executions) more than a machine with this noise explains? Markov: of
/// all executions at most a share E/x meets noise of x or more, where E is the noise expected in one.
[[nodiscard]] bool is_beyond_noise(std::vector<Duration> excess, std::uint64_t jobs, Duration wcet, const Loss &noise);

/// What a Histogram knows of a task's executions, as processor time.
struct ExecutionPercentiles {
  std::uint64_t jobs = 0;
  Duration p50 = 0;
  Duration p99 = 0;
  Duration longest = 0;
};

/// The same where the single executions are not kept. `calibrated`: nothing is plausible_overheads().
[[nodiscard]] bool is_beyond_noise(const ExecutionPercentiles &executions, Duration wcet,
                                   const std::optional<Overheads> &calibrated);

struct Remark {
  bool is_alarm = false;
  TaskId task;
  std::string text;  // "control.imu: ...", without a period
};

/// What is to be said, alarms first.
[[nodiscard]] std::vector<Remark> remarks(const AssumptionCheck &check, const Workload &workload);

/// What to add to bounds that do not count what the machine costs.
[[nodiscard]] const char *not_calibrated_hint();

}  // namespace redag::metrics
