// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Every method on one system: which apply, why the others do not, and the tightest sound bound of each task and DAG
// with the method that gave it. A pure function.
#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "redag_analysis/core/bound.hpp"
#include "redag_analysis/core/effort.hpp"

namespace redag::analysis {

struct MethodReport {
  const Method *method = nullptr;
  Outcome outcome;
  Verdict verdict = Verdict::NotShown;
  bool trusted = false;  // it applies and its numbers are sound here

  [[nodiscard]] const Bound *bound() const { return std::get_if<Bound>(&outcome); }
  [[nodiscard]] bool gave_up() const { return bound() == nullptr && std::get<NotApplicable>(outcome).gave_up; }
};

/// The smallest trusted response bound; of equal ones the first in the order of methods().
struct Tightest {
  std::optional<Duration> response;
  const Method *method = nullptr;  // null: no trusted method gave one
  ResponseBound bound;
};

struct Report {
  std::vector<MethodReport> methods;
  std::vector<Tightest> tasks;  // by TaskId
  std::vector<Tightest> dags;   // by DagId
  Verdict verdict = Verdict::NotShown;
  /// Who says so: methods that accept all, or those that gave the tightest bounds. Empty when NotShown.
  std::vector<const Method *> by;
  /// What the pointers to methods above point into, unless that is methods(): good as long as a copy of the report is.
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
  /// Asked now and then while a method works: a reason, a clause without a period, ends the method. Null: never.
  std::function<std::string(const AnalysisProgress &progress)> stop;
  /// n^2 terms in all: of few tasks, or else one at a time with itemised().
  bool itemise = false;
};

/// Runs methods(). Memory is linear in the size of the system unless it itemises. A method that is ended is
/// NotApplicable with `gave_up`; the others say what they say.
[[nodiscard]] Report analyze(const System &system, const AnalyzeOptions &options = {});
/// These methods alone; the report keeps them.
[[nodiscard]] Report analyze(const System &system, std::vector<Method> methods, const AnalyzeOptions &options = {});

/// The same bound with its terms: runs the method again. Requires one with a method.
[[nodiscard]] ResponseBound itemised(const System &system, const Tightest &tightest, TaskId task);
[[nodiscard]] ResponseBound itemised(const System &system, const Tightest &tightest, DagId dag);

/// The tightest bounds together, as if one method had given them.
[[nodiscard]] Bound tightest_of(const Report &report);

/// Is analyze(system).verdict Schedulable? Asks tests that answer at once first, and stops at the first method that
/// says so: for those who ask it often. Throws Effort::GaveUp where a scope of the caller's ends it.
[[nodiscard]] bool is_shown_schedulable(const System &system);

}  // namespace redag::analysis
