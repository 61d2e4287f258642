// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The findings of the trace checker: violations by rule, and the number of tests of each rule. A rule without tests
// proves nothing. Plain values.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "redag/base/ids.hpp"
#include "redag/base/time.hpp"

namespace redag::metrics {

/// The rules of docs/model.md that the checker can hold a trace to.
enum class Rule : std::uint8_t {
  Stream,            // times never decrease, ids exist, nothing is lost
  Life,              // state transitions, numbers from 0 upwards, no job twice
  Conservation,      // released = finished + skipped + aborted + in flight, for every task
  Grid,              // timer job k is released for start + offset + k * T, and none is left out
  Precedence,        // ready exactly when every predecessor has fresh data; data jobs released then
  Admission,         // jobs are skipped exactly when, and for the reason that, the model says
  Deadline,          // absolute deadline = r + D
  TaskOverlap,       // jobs of one task never overlap beyond its concurrency, and start in order of release
  MaxActive,         // a DAG has at most max_active jobs started and unfinished; all together at most max_started
  Group,             // jobs of one group never overlap
  Worker,            // a worker runs one job at a time; suspended jobs continue in LIFO order (cooperative)
  Preemption,        // only in modes that have it, at preemption points, by more urgent jobs
  Priority,          // no eligible job waits while a less urgent one is chosen or (full) runs
  WorkConservation,  // no worker is free while an eligible job waits
  Deferral,          // deferred exactly when max_active alone kept the job from an available worker
  Budget,            // a job that used its budget is told so; HI mode begins and ends by its rules
  Execution,         // simulator: a job held a worker for exactly its execution time
  Start,             // threads, full: a dispatched job's body begins before less urgent bodies run for long
  Device,            // a job waits where its task does; devices serve in order, and are not idle while one waits
};
inline constexpr std::size_t kRuleCount = 19;

[[nodiscard]] const char *to_string(Rule rule);

/// Returns true if another rate, deadline or level can make a lawful event a violation of the rule.
[[nodiscard]] bool follows_from_rates(Rule rule);

/// The rules that a trace is held to.
class RuleSet {
 public:
  /// All rules, for ReDAG-RT's own executors.
  [[nodiscard]] static RuleSet all();
  /// The rules for rclcpp's executors and their models. Priority, WorkConservation, Deferral, Preemption, MaxActive and
  /// Budget are left out, because those executors do not have them.
  [[nodiscard]] static RuleSet rclcpp();

  [[nodiscard]] RuleSet without(Rule rule) const;
  [[nodiscard]] bool contains(Rule rule) const { return ((bits_ >> static_cast<unsigned>(rule)) & 1U) != 0; }

 private:
  std::uint32_t bits_ = (1U << kRuleCount) - 1;
};

struct Violation {
  Rule rule = Rule::Stream;
  Time time = 0;
  std::size_t event = 0;  // index of the event at which it was found
  std::string job;        // "control.ekf#12"
  std::string text;

  /// "12.5ms control.ekf#12: priority: ..."
  [[nodiscard]] std::string to_string() const;
};

struct CheckReport {
  /// The number of violations whose text is kept; the others are only counted.
  static constexpr std::size_t kMaxKept = 200;

  std::vector<Violation> violations;
  std::uint64_t violation_count = 0;
  std::uint64_t not_judged = 0;  // tests not made, because rates changed later; see trace::RunInfo::settled
  std::array<std::uint64_t, kRuleCount> violations_by_rule{};
  std::array<std::uint64_t, kRuleCount> checks_by_rule{};

  [[nodiscard]] bool ok() const { return violation_count == 0; }
  [[nodiscard]] std::uint64_t checks(Rule rule) const { return checks_by_rule[static_cast<std::size_t>(rule)]; }
  [[nodiscard]] std::uint64_t violated(Rule rule) const { return violations_by_rule[static_cast<std::size_t>(rule)]; }
  /// The first `at_most` violations, one a line, and the number of further ones.
  [[nodiscard]] std::string to_string(std::size_t at_most = 10) const;
};

}  // namespace redag::metrics
