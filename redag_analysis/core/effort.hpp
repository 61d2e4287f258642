// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// What an analysis may cost, and whether it itemises its bounds. The caller sets both for the current thread, and the
// loops of the methods check them. Every method is thus bounded in time without a parameter for it. Outside any scope a
// method itemises all bounds and runs to its end.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

namespace redag::analysis {

/// The default limit on the steps of a method, a few seconds. One step looks at one other task in one evaluation.
inline constexpr std::uint64_t kUsualEffort = 500'000'000;

/// Selects the bounds that are itemised. The terms of all n tasks would be n^2 terms.
struct Itemised {
  enum class Which : std::uint8_t { None, Units, All };
  Which which = Which::All;
  std::vector<std::uint32_t> units;  // positions in TaskSet::units, for Units
};

/// The progress of the running method, to show to a reader.
struct EffortAt {
  std::uint64_t steps = 0;
  double done = 0;  // in [0, 1]; 0 where the method cannot tell
};

class Effort {
 public:
  struct Limits {
    std::uint64_t steps = 0;  // 0: no limit
    /// Called after every million steps. A non-empty reason ends the method.
    std::function<std::string(const EffortAt &)> stop;
    Itemised itemised;
  };

  /// Thrown by spend(), and caught by the code that created `scope`.
  struct GaveUp {
    const Effort *scope;
    std::string why;  // a clause without a period
  };

  /// Opens a scope on this thread until it is destroyed, inside the scope that is open already. `limits` must outlive
  /// it.
  explicit Effort(const Limits &limits) : limits_(limits), outer_(current) { current = this; }
  ~Effort() { current = outer_; }
  Effort(const Effort &) = delete;
  Effort &operator=(const Effort &) = delete;

  [[nodiscard]] std::uint64_t steps() const { return at_.steps + unseen_; }

  /// Counts steps, and throws GaveUp when they exceed a limit of any open scope. Cheap.
  static void spend(std::uint64_t steps) {
    if (current == nullptr) return;
    current->unseen_ += steps;
    if (current->unseen_ >= kLookEvery) look();
  }
  /// Reports that `part` of `whole` units are done. Assumes that the cost of a unit grows linearly with its position.
  static void reached(std::size_t part, std::size_t whole);
  /// True if the bounds of this unit are to be itemised.
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
