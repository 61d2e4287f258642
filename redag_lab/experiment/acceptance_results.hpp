// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The results of the experiment "acceptance": counts by point and method, as CSV, JSON and a plot. They follow from the
// plan and the units alone; only the JSON adds the runs. Pure functions, apart from write_results().
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "redag/base/result.hpp"
#include "redag_lab/experiment/acceptance.hpp"
#include "redag_lab/experiment/finished_unit.hpp"
#include "redag_lab/experiment/proportion.hpp"
#include "redag_lab/experiment/unit_store.hpp"

namespace redag::experiment {

/// The counts of one method at one point.
struct AcceptanceCell {
  std::uint64_t accepted = 0;        // includes `unsound`
  std::uint64_t unsound = 0;         // accepted by an equation whose hypotheses do not hold
  std::uint64_t not_applicable = 0;  // counted as not accepted
};

struct AcceptanceRow {
  AcceptancePoint point;
  std::uint64_t sets = 0;             // finished workloads
  std::vector<AcceptanceCell> cells;  // by method of the plan
};

/// A unit that a sound method accepted although the simulation saw a missed deadline.
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

/// Counts the units one by one.
class AcceptanceCounter {
 public:
  explicit AcceptanceCounter(const Acceptance &acceptance);

  /// Adds a unit. Error: a unit or a result that the plan does not have.
  [[nodiscard]] Result<void> add(std::uint64_t unit, const std::string &result);
  [[nodiscard]] const AcceptanceResults &results() const { return results_; }

 private:
  const Acceptance &acceptance_;
  AcceptanceResults results_;
};

/// Returns a row per point and method; the same bytes for the same units. docs/experiments.md lists the columns.
[[nodiscard]] std::string to_csv(const Acceptance &acceptance, const AcceptanceResults &results);
/// `runs` holds JSON texts (folder.hpp).
[[nodiscard]] std::string to_json(const Acceptance &acceptance, const AcceptanceResults &results,
                                  const std::vector<std::string> &runs);
/// Draws a panel for each combination except the utilization, with a line for each method.
[[nodiscard]] std::string to_svg(const Acceptance &acceptance, const AcceptanceResults &results);

/// Writes acceptance.csv, .json and .svg, and violation-<unit>.yaml for the first violations. Each file is replaced as
/// a whole.
[[nodiscard]] Result<void> write_results(const std::string &folder, const Acceptance &acceptance,
                                         const AcceptanceResults &results);

}  // namespace redag::experiment
