// What all fixed-priority bounds for one worker share: when they apply, who interferes, who blocks, and the fixed
// points themselves. Works on units, so that a DAG on one core is one task with C = its volume. Pure functions.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "redag/analysis/bound.hpp"

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
  std::vector<Interferer> more_urgent;
  std::vector<std::uint32_t> units;  // of `more_urgent`, position by position
  std::vector<Blocker> blockers;     // each at most once in a busy period
  Duration blocking = 0;             // their sum
  /// The unit's own priorities and those of others are interleaved, so that its view is coarser than its priority.
  bool interleaved = false;
};

/// Who can delay `unit`. The level of the busy period is the least urgent task of the unit, lowered until no other unit
/// lies on both sides of it (docs/analysis.md, "One worker"). O(n log n).
[[nodiscard]] View view_of(const System &system, std::uint32_t unit);

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
