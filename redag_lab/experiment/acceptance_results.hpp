// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// What the units of the experiment "acceptance" come to: counts a point and method, as CSV, JSON and a plot. All of it
// follows from the plan and the units; only the JSON adds who worked on it. Pure functions but for write_results().
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "redag/base/result.hpp"
#include "redag_lab/experiment/acceptance.hpp"
#include "redag_lab/experiment/journal.hpp"
#include "redag_lab/experiment/proportion.hpp"

namespace redag::experiment {

/// One method at one point.
struct AcceptanceCell {
  std::uint64_t accepted = 0;        // those of `unsound` included
  std::uint64_t unsound = 0;         // accepted by an equation whose hypotheses do not hold
  std::uint64_t not_applicable = 0;  // counted as not accepted
};

struct AcceptanceRow {
  AcceptancePoint point;
  std::uint64_t sets = 0;             // finished ones
  std::vector<AcceptanceCell> cells;  // by method of the plan
};

/// A sound method accepted what missed a deadline in the simulation.
struct Violation {
  std::uint64_t unit = 0;
  std::string result;
  std::vector<std::string> methods;
};

struct AcceptanceResults {
  std::vector<AcceptanceRow> rows;  // by point
  std::uint64_t units = 0;          // of the plan
  std::uint64_t done = 0;
  std::vector<Violation> violations;

  [[nodiscard]] bool complete() const { return done == units; }
};

/// Counts one unit after the other.
class AcceptanceCounter {
 public:
  explicit AcceptanceCounter(const Acceptance &acceptance);

  /// Error: a unit or a result that the plan does not have.
  [[nodiscard]] Result<void> add(std::uint64_t unit, const std::string &result);
  [[nodiscard]] const AcceptanceResults &results() const { return results_; }

 private:
  const Acceptance &acceptance_;
  AcceptanceResults results_;
};

/// A row per point and method; the same bytes for the same units. Columns: docs/experiments.md.
[[nodiscard]] std::string to_csv(const Acceptance &acceptance, const AcceptanceResults &results);
/// `runs`: JSON texts (folder.hpp).
[[nodiscard]] std::string to_json(const Acceptance &acceptance, const AcceptanceResults &results,
                                  const std::vector<std::string> &runs);
/// A panel for each combination but for the utilization, with a line for each method.
[[nodiscard]] std::string to_svg(const Acceptance &acceptance, const AcceptanceResults &results);

/// Writes acceptance.csv, .json and .svg, and violation-<unit>.yaml for the first violations. Each appears whole.
[[nodiscard]] Result<void> write_results(const std::string &folder, const Acceptance &acceptance,
                                         const AcceptanceResults &results);

}  // namespace redag::experiment
