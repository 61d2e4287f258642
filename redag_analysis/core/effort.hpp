// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// What an analysis may cost, and whether it itemises its bounds: set by the caller for the current thread, looked at by
// the loops of the methods, so that every method is bounded in time and none needs a parameter for it. Outside any
// scope a method itemises all bounds and runs to its end.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

namespace redag::analysis {

/// Steps that a method may take by default, a few seconds: one step looks at one other task in one evaluation.
inline constexpr std::uint64_t kUsualEffort = 500'000'000;

/// Whose bounds are itemised: terms of all n tasks are n^2 terms.
struct Itemised {
  enum class Which : std::uint8_t { None, Units, All };
  Which which = Which::All;
  std::vector<std::uint32_t> units;  // positions in System::units, for Units
};

/// How far the method at work is, for people.
struct EffortAt {
  std::uint64_t steps = 0;
  double done = 0;  // in [0, 1]; 0 where the method cannot tell
};

class Effort {
 public:
  struct Limits {
    std::uint64_t steps = 0;  // 0: no limit
    /// Asked every few milliseconds. A reason ends the method.
    std::function<std::string(const EffortAt &)> stop;
    Itemised itemised;
  };

  /// Thrown out of spend(), caught by whoever made `scope`.
  struct GaveUp {
    const Effort *scope;
    std::string why;  // a clause without a period
  };

  /// Until it is destroyed: on this thread, inside the scope that is there already. `limits` must outlive it.
  explicit Effort(const Limits &limits) : limits_(limits), outer_(current) { current = this; }
  ~Effort() { current = outer_; }
  Effort(const Effort &) = delete;
  Effort &operator=(const Effort &) = delete;

  /// Counted so far.
  [[nodiscard]] std::uint64_t steps() const { return at_.steps + unseen_; }

  /// Counts steps; throws GaveUp at a limit of any scope. Cheap.
  static void spend(std::uint64_t steps) {
    if (current == nullptr) return;
    current->unseen_ += steps;
    if (current->unseen_ >= kLookEvery) look();
  }
  /// `part` of `whole` units are done, each dearer than the one before by the same amount.
  static void reached(std::size_t part, std::size_t whole);
  /// Are the bounds of this unit to be itemised?
  [[nodiscard]] static bool itemises(std::uint32_t unit);

 private:
  static constexpr std::uint64_t kLookEvery = 1'000'000;

  static void look();
  void count(std::uint64_t steps, double done);

  static thread_local Effort *current;

  const Limits &limits_;
  Effort *outer_;
  std::uint64_t unseen_ = 0;
  EffortAt at_;
};

}  // namespace redag::analysis
