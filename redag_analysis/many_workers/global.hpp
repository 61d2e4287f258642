// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// What the bounds for several workers share: when global scheduling by whole units applies, each unit in numbers, and
// exact shares of a divided sum. Values only; pure functions. The bounds themselves are in files of their own.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "redag_analysis/core/bound.hpp"

namespace redag::analysis::global {

/// A unit as the bounds see it. Times of a window are measured from the release as seen, responses from the nominal
/// one.
struct GlobalUnit {
  Duration volume = 0;
  Duration length = 0;
  Duration period = 0;
  Duration jitter = 0;
  Duration limit = 0;     // responses above it count as none; never above the period
  Duration response = 0;  // of the bound at work, once known
  Duration work = 0;      // in the window at hand, and with a job from before: scratch of the fixed points
  Duration carried = 0;
  Duration turn = 0;             // width * period, see divide()
  double rate = 0;               // 1 / turn
  std::uint32_t width = 1;       // jobs of it that can execute at once, never above the workers
  std::uint32_t bound = 0;       // max_active where it binds, or 0
  std::uint32_t tasks = 1;       // how many
  std::uint32_t path_tasks = 1;  // most tasks on a path
  Duration path_overhead = 0;    // platform's part of `length`
  std::uint32_t unit = 0;        // position in System::units
};

/// Which systems a bound is for.
struct Needs {
  sched::Preemption mode = sched::Preemption::Full;
  bool edges = true;        // also units of several tasks
  bool bounds = false;      // also max_active, of DAGs that are one unit
  bool groups = false;      // also exclusive groups
  bool equals = false;      // also units that share a level, of which any can go first: see peers_of()
  bool any_policy = false;  // also policies whose priorities are not static; then the order means nothing
};

/// The units most urgent first, or why the bound does not apply. Beyond `Needs`: the priorities of two units are not
/// interleaved, and no sum of workloads exceeds an integer.
struct Units {
  std::optional<std::string> reason;
  std::vector<GlobalUnit> units;
  std::uint32_t workers = 1;
};
[[nodiscard]] Units units_of(const System &system, const Needs &needs);

/// Where the units of which units[k] is one share levels: any of them can go before any other. By level where jobs can
/// be preempted, else by tier: what has started then counts as blocking. Nearly always units[k] alone.
struct Peers {
  std::size_t begin = 0;
  std::size_t end = 0;
};
[[nodiscard]] Peers peers_of(const System &system, const std::vector<GlobalUnit> &units, std::size_t k);

/// One unit alone; its order among the others is not looked at.
[[nodiscard]] GlobalUnit unit_of(const System &system, std::uint32_t unit);

/// No response is within its limit: more work than the workers can do until then. With such a unit sums can wrap.
[[nodiscard]] bool is_hopeless(const GlobalUnit &unit, std::uint32_t workers);
[[nodiscard]] bool is_any_hopeless(std::span<const GlobalUnit> units, std::uint32_t workers);

/// Lets at most `width` jobs of the unit execute at once.
void set_width(GlobalUnit &unit, std::uint32_t width);

/// Quotient and remainder by `turn` without a division instruction. Requires 0 <= value < 2^52, exact then.
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

/// Terms of a response out of shares of a sum that is divided by the workers and rounded down once: they add up to it.
/// None where the unit is not to be itemised (effort.hpp).
class SharedTerms {
 public:
  SharedTerms(const System &system, const GlobalUnit &unit);

  /// Time of its own: `length` of the longest path, `overhead` of it the platform's, and the release seen late.
  void add_path();
  void add_jitter();
  void add(Term::Kind kind, const GlobalUnit &whose, Duration amount, std::int64_t jobs = 0);
  void add(const Term &term);
  /// `numerator` / `denominator` more; what has been added so far is always rounded down once.
  void add_share(Term::Kind kind, const GlobalUnit &whose, Duration numerator, Duration denominator,
                 std::int64_t jobs = 0);
  [[nodiscard]] std::vector<Term> take() { return std::move(terms_); }
  [[nodiscard]] bool wanted() const { return wanted_; }

 private:
  void push(Term::Kind kind, const GlobalUnit &whose, Duration amount, std::int64_t jobs);

  const System &system_;
  const GlobalUnit &unit_;
  bool wanted_;
  std::vector<Term> terms_;
  Duration remainder_ = 0;
  Duration denominator_ = 1;
};

/// The sum of the `count` largest less urgent jobs' remaining times when they are in the way of something that
/// became ready later ("- 1": they started at an instant strictly before), at most `width` of a unit.
[[nodiscard]] Duration largest_remaining(const System &system, const std::vector<GlobalUnit> &units, std::size_t from,
                                         std::uint32_t count);

inline constexpr std::string_view kExceedsLimit = "its response exceeds the limit: jobs would be skipped";
inline constexpr std::string_view kMoreUrgent = "something more urgent has no bound";
inline constexpr std::string_view kPeer = "something of the same priority has no bound";
inline constexpr std::string_view kNoFixedPoint =
    "no fixed point within its limit, above which jobs would be skipped, in the steps allowed";

/// Evaluations of one fixed point; ordinary systems need tens.
inline constexpr int kMaxSteps = 10'000;

}  // namespace redag::analysis::global
