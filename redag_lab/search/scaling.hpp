// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Changes the load of a workload by one number, for the sensitivity analysis and its readers' questions. Every knob's
// position grows with the load. Values only; pure functions.
#pragma once

#include <cstdint>
#include <vector>

#include "redag/model/workload.hpp"
#include "redag_analysis/core/task_set.hpp"

namespace redag::lab {

/// The unit of factors, which are counted in millionths.
inline constexpr std::int64_t kFactorUnit = 1'000'000;

/// A quantity that can grow.
struct Knob {
  enum class Kind : std::uint8_t {
    Wcet,      // position: the wcet in ns
    AllWcets,  // position: a factor in millionths; wcets are rounded up
  };
  Kind kind = Kind::AllWcets;
  std::vector<std::uint32_t> tasks;  // TaskIds: one for Wcet, at least one otherwise

  friend bool operator==(const Knob &, const Knob &) = default;
};

/// Returns the knob's position in `workload`. Requires valid TaskIds.
[[nodiscard]] std::int64_t nominal_position(const Workload &workload, const Knob &knob);

/// Returns the workload with the knob turned. The bcet, the execution-time model and the longest region change in
/// proportion; budgets and deadlines stay. The result need not be valid; compile() reports it. Requires a position > 0
/// and a valid workload.
[[nodiscard]] Workload turned(const Workload &workload, const Knob &knob, std::int64_t position);

/// Returns the load at `position` relative to the workload's own, above 1 where it grew. For display.
[[nodiscard]] double load_factor(const Workload &workload, const Knob &knob, std::int64_t position);

}  // namespace redag::lab
