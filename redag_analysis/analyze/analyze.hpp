// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Applies every method to one task set: which apply, why the others do not, and the tightest sound bound of each task
// and DAG with the method that gave it. A pure function.
#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "redag_analysis/core/bound.hpp"
#include "redag_analysis/core/effort.hpp"
#include "redag_analysis/core/most_urgent.hpp"

namespace redag::analysis {

struct MethodReport {
  const Method *method = nullptr;
  Outcome outcome;
  Verdict verdict = Verdict::NotShown;
  bool trusted = false;  // the method applies and its numbers are sound here

  [[nodiscard]] const Bound *bound() const { return std::get_if<Bound>(&outcome); }
  [[nodiscard]] bool gave_up() const { return bound() == nullptr && std::get<NotApplicable>(outcome).gave_up; }
};

/// The smallest trusted response bound; of equal ones the first in the order of methods().
struct Tightest {
  std::optional<Duration> response;
  const Method *method = nullptr;  // null: no trusted method gave one
  ResponseBound bound;
  std::shared_ptr<const MostUrgent> part{};  // the tasks among which the method gave it; null: all
};

struct Report {
  std::vector<MethodReport> methods;
  std::vector<Tightest> tasks;  // by TaskId
  std::vector<Tightest> dags;   // by DagId
  Verdict verdict = Verdict::NotShown;
  /// The methods behind the verdict: those that accept all, or those that gave the tightest bounds. Empty when
  /// NotShown.
  std::vector<const Method *> by;
  /// Owns the methods that the pointers above refer to, unless these are methods(). The pointers stay valid as long as
  /// some copy of the report exists.
  std::shared_ptr<const std::vector<Method>> owned;
};

struct AnalysisProgress {
  const Method &method;
  std::size_t index = 0;  // of `count` methods
  std::size_t count = 0;
  EffortAt at;
};

struct AnalyzeOptions {
  std::uint64_t effort = kUsualEffort;  // steps of one method; 0: no limit
  /// Called regularly while a method works. A non-empty reason, a clause without a period, ends the method. Null:
  /// never.
  std::function<std::string(const AnalysisProgress &progress)> stop;
  /// Itemises all bounds, n^2 terms in all. Use it for few tasks only; otherwise itemise one bound at a time with
  /// itemised().
  bool itemise = false;
};

/// Runs methods(). If a task has no bound, runs them again on the most urgent tasks alone (most_urgent.hpp), for the
/// bounds of these. Memory is linear in the size of the task set unless it itemises. A method that is ended counts as
/// NotApplicable with `gave_up`; this does not affect the others.
[[nodiscard]] Report analyze(const TaskSet &task_set, const AnalyzeOptions &options = {});
/// Runs these methods alone, each of them; the report keeps them.
[[nodiscard]] Report analyze(const TaskSet &task_set, std::vector<Method> methods, const AnalyzeOptions &options = {});

/// Runs the method again, and returns the same bound with its terms. Requires a bound with a method.
[[nodiscard]] ResponseBound itemised(const TaskSet &task_set, const Tightest &tightest, TaskId task);
[[nodiscard]] ResponseBound itemised(const TaskSet &task_set, const Tightest &tightest, DagId dag);

/// Combines the tightest bounds, as if one method had given them.
[[nodiscard]] Bound tightest_of(const Report &report);

/// True if analyze(task_set).verdict is Schedulable. For frequent calls: it stops at the first method that shows it.
/// Throws Effort::GaveUp if a scope of the caller ends it.
[[nodiscard]] bool is_shown_schedulable(const TaskSet &task_set);

}  // namespace redag::analysis
