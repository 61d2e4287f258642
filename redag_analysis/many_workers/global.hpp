// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// What the bounds for several workers share: when global scheduling by whole units applies, each unit in numbers, and
// exact shares of a divided sum. Values and pure functions only. The bounds themselves have their own files.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "redag_analysis/core/bound.hpp"

namespace redag::analysis::global {

/// A unit as the bounds see it. Times within a window count from the release as seen, and responses from the nominal
/// release.
struct GlobalUnit {
  // What the fixed points read of the more urgent units comes first, in one cache line.
  Duration volume = 0;
  Duration period = 0;
  Duration jitter = 0;
  Duration response = 0;  // of the current bound, once known
  Duration work = 0;      // in the current window, of which `carried` is an earlier job's; scratch of the fixed points
  Duration carried = 0;
  Duration length = 0;
  Duration limit = 0;            // a response above it counts as none; never above the period
  Duration turn = 0;             // width * period, see divide()
  double rate = 0;               // 1 / turn
  std::uint32_t width = 1;       // its jobs that can execute at once, never above the workers
  std::uint32_t bound = 0;       // max_active if it can bind, else 0
  std::uint32_t tasks = 1;       // their number
  std::uint32_t abreast = 1;     // the most of them that can execute at once while no two instances overlap
  std::uint32_t path_tasks = 1;  // most tasks on a path
  Duration path_overhead = 0;    // the platform's part of `length`
  std::uint32_t unit = 0;        // position in TaskSet::units
};

/// The task sets that a bound accepts.
struct Needs {
  sched::Preemption mode = sched::Preemption::Full;
  bool edges = true;        // units of several tasks
  bool bounds = false;      // max_active, of DAGs that are one unit
  bool groups = false;      // exclusive groups
  bool equals = false;      // units that share a level, of which any can go first: see peers_of()
  bool any_policy = false;  // policies whose priorities are not static; the order of units is then meaningless
};

/// The units, most urgent first, or why the bound does not apply. Beyond `Needs`, the priorities of two units must not
/// interleave, and sums of workloads must fit into an integer.
struct Units {
  std::optional<std::string> reason;
  std::vector<GlobalUnit> units;
  std::uint32_t workers = 1;
};
[[nodiscard]] Units units_of(const TaskSet &task_set, const Needs &needs);

/// The range of units that share levels with units[k]: any of them can go before any other. Where jobs can be preempted
/// levels count, else tiers, because a job that has started then counts as blocking. Nearly always units[k] alone.
struct Peers {
  std::size_t begin = 0;
  std::size_t end = 0;
};
[[nodiscard]] Peers peers_of(const TaskSet &task_set, const std::vector<GlobalUnit> &units, std::size_t k);

/// One unit alone; its place among the others is not determined.
[[nodiscard]] GlobalUnit unit_of(const TaskSet &task_set, std::uint32_t unit);

/// assume_overlap() sets `response` such that dag_work() holds for a unit without a bound, whose instances can overlap:
/// by the number of jobs that are released in a window, and of those that can be unfinished when it begins. Returns
/// false if sums could wrap.
[[nodiscard]] bool assume_overlap(const TaskSet &task_set, GlobalUnit &unit);

/// What a unit does before one of its tasks ends, if its instances do not overlap.
struct Part {
  std::vector<std::uint32_t> tasks;  // TaskIds: all that do not follow the task
  std::vector<std::uint32_t> paths;  // those that lead to the task, and the task
};
[[nodiscard]] Part part_until(const TaskSet &task_set, std::uint32_t task);

/// narrow() leaves of a unit only this part. Its work in the windows of others is not that of the part.
void narrow(const TaskSet &task_set, const Part &part, GlobalUnit &unit);

/// True if no response is within the limit: there is more work than the workers can do until then. Sums of such a unit
/// can wrap.
[[nodiscard]] bool is_hopeless(const GlobalUnit &unit, std::uint32_t workers);
[[nodiscard]] bool is_any_hopeless(std::span<const GlobalUnit> units, std::uint32_t workers);

/// Lets at most `width` jobs of the unit execute at once.
void set_width(GlobalUnit &unit, std::uint32_t width);

/// Quotient and remainder by `turn` without a division instruction. Exact; requires 0 <= value < 2^52.
struct Division {
  Duration quotient = 0;
  Duration remainder = 0;
};
[[nodiscard]] inline Division divide(Duration value, const GlobalUnit &by) {
  auto quotient = static_cast<Duration>(static_cast<double>(value) * by.rate);
  Duration remainder = value - quotient * by.turn;
  if (remainder < 0) {
    --quotient;
    remainder += by.turn;
  } else if (remainder >= by.turn) {
    ++quotient;
    remainder -= by.turn;
  }
  return {quotient, remainder};
}

/// Builds the terms of a response from shares of a sum that is divided by the workers and rounded down once; the terms
/// add up to the response. There are none if the unit is not itemised (effort.hpp).
class SharedTerms {
 public:
  SharedTerms(const TaskSet &task_set, const GlobalUnit &unit);

  /// Makes room for this many terms.
  void reserve(std::size_t count) {
    if (wanted_) terms_.reserve(count);
  }
  /// Adds the unit's own time: `length` of the longest path, of which the platform's overhead is a term of its own.
  void add_path();
  void add_jitter();
  void add(Term::Kind kind, const GlobalUnit &whose, Duration amount, std::int64_t jobs = 0);
  void add(const Term &term);
  /// Adds `numerator` / `denominator`. The sum of all shares so far is rounded down once.
  void add_share(Term::Kind kind, const GlobalUnit &whose, Duration numerator, Duration denominator,
                 std::int64_t jobs = 0);
  /// Adds a share of less urgent work that no single unit causes.
  void add_blocking(Duration numerator, Duration denominator);
  /// The terms that follow are those of a device, until at() with none. The first ones are of no device.
  void at(DeviceId device) { device_ = device; }
  [[nodiscard]] std::vector<Term> take() { return std::move(terms_); }
  [[nodiscard]] bool wanted() const { return wanted_; }

 private:
  void push(Term::Kind kind, const GlobalUnit &whose, Duration amount, std::int64_t jobs);
  // Returns what this share adds to the sum of all shares, rounded down.
  [[nodiscard]] Duration take_share(Duration numerator, Duration denominator);

  const TaskSet &task_set_;
  const GlobalUnit &unit_;
  bool wanted_;
  std::vector<Term> terms_;
  DeviceId device_;
  Duration remainder_ = 0;
  Duration denominator_ = 1;
};

/// Sums the `count` largest remaining times of less urgent jobs that block something that became ready later, at most
/// its max_active of a unit. Each counts with "- 1", because it started at an instant strictly before.
[[nodiscard]] Duration largest_remaining(const TaskSet &task_set, const std::vector<GlobalUnit> &units,
                                         std::size_t from, std::uint32_t count);

inline constexpr std::string_view kExceedsLimit =
    "its bound exceeds the time after which the next release would skip a job";
inline constexpr std::string_view kMoreUrgent = "a more urgent task or DAG has no bound";
inline constexpr std::string_view kPeer = "a task or DAG of the same priority has no bound";
inline constexpr std::string_view kNoFixedPoint =
    "the analysis finds no response time that ends before the next release skips a job";

/// Limits the evaluations of one fixed point; ordinary task sets need tens.
inline constexpr int kMaxSteps = 10'000;

}  // namespace redag::analysis::global
