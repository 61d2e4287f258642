// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// What all fixed-priority bounds for one worker share: when they apply, who interferes, who blocks, and the fixed
// points themselves. Works on units, so that a DAG on one core is one task with C = its volume. Pure functions.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "redag/base/int128.hpp"
#include "redag_analysis/core/bound.hpp"

namespace redag::analysis::one_worker {

/// Nothing, or why no fixed-priority bound for one worker applies. What they all need: m = 1, a static policy, and no
/// wait of a started job that its priority does not explain:
/// - bounds of a DAG whose tasks are several units (a bound is not inherited), where jobs are preempted;
/// - groups in cooperative mode (a holder lies under others on its stack), or with an overhead of preemption.
[[nodiscard]] std::optional<std::string> why_not(const System &system);

struct Interferer {
  Duration wcet = 0;
  Duration period = 0;
  Duration jitter = 0;
};

struct Blocker {
  std::uint32_t task = 0;  // TaskId
  Duration amount = 0;
};

/// One unit's view of the system.
struct View {
  std::vector<Interferer> more_urgent;  // those of one period and jitter together, as one
  std::vector<Blocker> blockers;        // each at most once in a busy period
  Duration blocking = 0;                // their sum
};

/// Who can delay each unit. The level of the busy period is the least urgent task of the unit, lowered until no tier
/// and no other unit lies on both sides of it (docs/analysis.md, "One worker"). Memory is linear in the size of the
/// system.
class Views {
 public:
  /// `system` must outlive it. O(n log n).
  explicit Views(const System &system);

  /// Units from the most urgent level to the least: of() is cheap in this order.
  [[nodiscard]] const std::vector<std::uint32_t> &order() const { return order_; }
  /// The level of the busy period as a rank: all work of this rank and above belongs to whole units.
  [[nodiscard]] std::uint32_t level(std::uint32_t unit) const { return closed_[system_.units[unit].last_rank]; }
  /// Units with a task of this rank or above, `unit` among them, most urgent first.
  [[nodiscard]] std::span<const std::uint32_t> down_to(std::uint32_t level) const;
  /// The units that can interfere, in the order of System::units.
  [[nodiscard]] std::vector<std::uint32_t> more_urgent(std::uint32_t unit) const;
  /// Who blocks, and for how long in all. O(members of groups).
  [[nodiscard]] std::vector<Blocker> blockers(std::uint32_t unit) const;
  [[nodiscard]] Duration blocking(std::uint32_t unit) const;
  /// O(different periods), beyond what the step from the unit asked for before costs.
  [[nodiscard]] View of(std::uint32_t unit);

 private:
  // Units of one period and jitter.
  struct Class {
    Duration period = 0;
    Duration jitter = 0;
    Int128 wcet = 0;  // of those in `counted_`
  };

  void count_down_to(std::uint32_t level);
  void close_levels();
  void find_longest();

  const System &system_;
  std::vector<std::uint32_t> by_first_rank_;  // units
  std::vector<std::uint32_t> order_;
  std::vector<std::uint32_t> closed_;  // by rank: the first level from it on that splits no unit and no tier
  std::vector<Blocker> longest_;       // by rank: the longest stretch from it on that nothing preempts
  std::vector<Class> classes_;
  std::vector<std::uint32_t> class_of_;  // by unit
  std::size_t counted_ = 0;              // first so many of by_first_rank_ are in classes_
};

/// A task in its busy period.
struct Own {
  Duration wcet = 0;
  Duration period = 0;
  Duration jitter = 0;
  Duration limit = 0;  // responses above it count as none
  Duration blocking = 0;
  Duration last_region = 0;  // not preempted in its last part; 0: preempted at any time
};

struct Response {
  Duration response = 0;
  Duration window = 0;      // from the start of the busy period to the finish, or to the start of the last region
  std::int64_t job = 0;     // q, which job of the busy period has it
  Duration from_ready = 0;  // largest of w(q) + F - max(0, q T - J): from readiness, which is never before t0
};

/// Why a fixed point gave nothing.
inline constexpr std::string_view kExceedsLimit = "its response exceeds the limit: jobs would be skipped";
inline constexpr std::string_view kGaveUp = "gave up: the busy period is too long to examine";

struct FixedPoint {
  std::optional<Response> found;
  std::string_view absent;
};

/// R = max_q J + w(q) - q T with w(q) = B + (q + 1) C + sum ceil((w(q) + J_j) / T_j) C_j. Ends at the end of the busy
/// period, at the first response above the limit, or after a fixed number of steps.
[[nodiscard]] FixedPoint preemptive_response(const Own &own, std::span<const Interferer> more_urgent);

/// R = max_q J + w(q) - q T + F with w(q) = B + (q + 1) C - F + sum (floor((w(q) + J_j) / T_j) + 1) C_j over all jobs
/// of the busy period, whose length is another fixed point. Requires F > 0.
[[nodiscard]] FixedPoint deferred_response(const Own &own, std::span<const Interferer> more_urgent);

/// How many jobs of `task` the window of a response holds: with ceil(), or floor() + 1 before a last region.
[[nodiscard]] std::int64_t jobs_in(const Interferer &task, Duration window, bool deferred);

/// The fixed point of every unit as response bounds with their terms.
[[nodiscard]] Bound bound_units(const System &system, bool deferred);

}  // namespace redag::analysis::one_worker
