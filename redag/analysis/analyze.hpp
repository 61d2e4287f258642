// Every method on one system: which apply, why the others do not, and the tightest sound bound of each task and DAG
// with the method that gave it. A pure function.
#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "redag/analysis/bound.hpp"

namespace redag::analysis {

struct MethodReport {
  const Method *method = nullptr;
  Outcome outcome;
  Verdict verdict = Verdict::NotShown;
  bool trusted = false;  // it applies and its numbers are sound here

  [[nodiscard]] const Bound *bound() const { return std::get_if<Bound>(&outcome); }
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

/// Runs methods(). Its cost is that of its dearest method; each states its own.
[[nodiscard]] Report analyze(const System &system);
/// These methods alone; the report keeps them.
[[nodiscard]] Report analyze(const System &system, std::vector<Method> methods);

/// The tightest bounds together, as if one method had given them.
[[nodiscard]] Bound tightest_of(const Report &report);

/// Is analyze(system).verdict Schedulable? Stops at the first method that says so: for those who ask it often.
[[nodiscard]] bool is_shown_schedulable(const System &system);

}  // namespace redag::analysis
