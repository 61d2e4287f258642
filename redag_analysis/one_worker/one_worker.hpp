// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// What all fixed-priority bounds for one worker share: when they apply, which units interfere, which block, and the
// fixed points themselves. They work on units: a DAG on one core is one task with C = its volume. Pure functions.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "redag/base/int128.hpp"
#include "redag_analysis/core/bound.hpp"

namespace redag::analysis::one_worker {

/// Returns why no fixed-priority bound for one worker applies; empty if they can apply. All of them need m = 1, a
/// static policy, and that its priority explains every wait of a started job. They refuse:
/// - a max_active of a DAG that is several units (a bound is not inherited), where jobs are preempted;
/// - groups in cooperative mode (a holder lies under others on its stack), or with an overhead of preemption.
[[nodiscard]] std::optional<std::string> why_not(const TaskSet &task_set);

struct Interferer {
  Duration wcet = 0;
  Duration period = 0;
  Duration jitter = 0;
};

struct Blocker {
  std::uint32_t task = 0;  // TaskId
  Duration amount = 0;
};

/// The units that can delay each unit. The level of the busy period is the least urgent task of the unit, lowered until
/// no tier and no other unit lies on both sides of it (docs/analysis.md, "One worker"). Memory is linear in the size of
/// the task set.
class Views {
 public:
  /// `task_set` must outlive this object. O(n).
  explicit Views(const TaskSet &task_set);

  /// The units that can interfere, in the order of TaskSet::units.
  [[nodiscard]] std::vector<std::uint32_t> more_urgent(std::uint32_t unit) const;
  /// The blockers, each at most once in a busy period, with its amount. O(members of groups).
  [[nodiscard]] std::vector<Blocker> blockers(std::uint32_t unit) const;

 private:
  // The level of the busy period as a rank: all work of this rank and above belongs to whole units.
  [[nodiscard]] std::uint32_t level(std::uint32_t unit) const { return closed_[task_set_.units[unit].last_rank]; }
  void close_levels();
  void find_longest();

  const TaskSet &task_set_;
  std::vector<std::uint32_t> closed_;  // by rank: the first level at or below it that splits no unit and no tier
  std::vector<Blocker> longest_;       // by rank: the longest stretch at or below it that nothing preempts
};

/// A task in its busy period.
struct Own {
  Duration wcet = 0;
  Duration period = 0;
  Duration jitter = 0;
  Duration limit = 0;  // a response above it counts as none
  Duration blocking = 0;
};

struct Response {
  Duration response = 0;
  Duration window = 0;      // from the start of the busy period to the finish, or to the start of the last region
  std::int64_t job = 0;     // q, the job of the busy period that has it
  Duration from_ready = 0;  // largest of w(q) + F - max(0, q T - J): from readiness, which is never before t0
};

/// Reasons for which a fixed point has no result.
inline constexpr std::string_view kExceedsLimit =
    "its bound exceeds the time after which the next release would skip a job";
inline constexpr std::string_view kGaveUp = "gave up: the busy period is too long";

struct FixedPoint {
  std::optional<Response> found;
  std::string_view absent;
};

/// R = max_q J + w(q) - q T with w(q) = B + (q + 1) C + sum ceil((w(q) + J_j) / T_j) C_j. Stops at the end of the busy
/// period, at the first response above the limit, or after a fixed number of steps.
[[nodiscard]] FixedPoint preemptive_response(const Own &own, std::span<const Interferer> more_urgent);

/// settle() finds the least w >= `window` with w = start + sum of what the others do in w, and counts its steps. With
/// `deferred` releases at the end of w count as well. Returns false if w exceeds `stop`, or if the steps run out.
[[nodiscard]] bool settle(bool deferred, Int128 start, std::span<const Interferer> more_urgent, Duration stop,
                          Duration &window, int &steps);

/// no_fixed_point() says why settle() found none.
[[nodiscard]] FixedPoint no_fixed_point(int steps);

/// The number of jobs of `task` in the window of a response: with ceil(), or floor() + 1 before a last region.
[[nodiscard]] std::int64_t jobs_in(const Interferer &task, Duration window, bool deferred);

}  // namespace redag::analysis::one_worker
