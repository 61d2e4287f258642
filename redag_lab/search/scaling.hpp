// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Changes to the load of a workload by one number: what sensitivity turns, and what a reader may ask about. Every
// knob's position grows with the load. Values only; pure functions.
#pragma once

#include <cstdint>
#include <vector>

#include "redag/model/workload.hpp"
#include "redag_analysis/core/system.hpp"

namespace redag::analysis {

/// Factors are counted in millionths.
inline constexpr std::int64_t kFactorUnit = 1'000'000;

/// Something that can grow: an execution time or a rate.
struct Knob {
  enum class Kind : std::uint8_t {
    Wcet,      // position: the wcet in ns
    AllWcets,  // position: a factor in millionths; wcets are rounded up
    Period,    // of tasks with one period, changed together; position: minus the period in ns
    Rates,     // of several tasks; position: a factor in millionths; periods are rounded down
  };
  Kind kind = Kind::AllWcets;
  std::vector<std::uint32_t> tasks;  // TaskIds: one for Wcet, at least one otherwise

  friend bool operator==(const Knob &, const Knob &) = default;
};

/// Where the knob stands in `workload`. Requires valid TaskIds.
[[nodiscard]] std::int64_t nominal_position(const Workload &workload, const Knob &knob);

/// The workload with the knob turned. With the wcet go, in proportion, the bcet, the execution-time model and the
/// longest region; with the period the deadlines that are equal to it. Jitter, offsets, budgets, explicit deadlines and
/// end-to-end deadlines stay. The result need not be valid: compile() says so. Requires a position > 0 (Period: < 0)
/// and a valid workload.
[[nodiscard]] Workload turned(const Workload &workload, const Knob &knob, std::int64_t position);

/// The load at `position` relative to the workload's own: above 1 where it grew. For people.
[[nodiscard]] double load_factor(const Workload &workload, const Knob &knob, std::int64_t position);

}  // namespace redag::analysis
