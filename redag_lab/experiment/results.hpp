// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The results of an experiment of any kind: rows of counts and figures, for results.csv, results.json and the page of
// `redag report`. They follow from the plan and the units alone. Pure functions.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "redag_lab/experiment/grid.hpp"

namespace redag::experiment {

struct Interval {
  double value = 0;
  double low = 0;
  double high = 0;
  double confidence = 0;  // of [low, high]

  friend bool operator==(const Interval &, const Interval &) = default;
};

/// Returns the median with a distribution-free interval between two of the values: the number of values below the true
/// median is binomially distributed. The confidence is at least 0.95 from six values on, and otherwise that of [least,
/// largest]. Requires at least one value.
[[nodiscard]] Interval median_of(std::vector<double> values);

/// Returns `hits` / `trials` with the score interval of E. B. Wilson, JASA 22(158), 1927, of 95 % confidence. It stays
/// within [0, 1] and has a length even where no trial or every trial hits. Requires hits <= trials, and a trial.
[[nodiscard]] Interval proportion(std::uint64_t hits, std::uint64_t trials);

struct ResultRow {
  Point point;
  std::vector<std::string> labels;               // by Results::labels
  std::vector<std::uint64_t> counts;             // by Results::counts
  std::vector<std::optional<Interval>> figures;  // by Results::figures; nothing where there is nothing to measure
};

struct Remark {
  bool good = true;
  std::string text;
};

struct Results {
  std::string name;
  std::string units_are;             // "runs"
  std::vector<Factor> factors;       // the last one has a line each in plots: executors, or methods
  std::vector<std::string> labels;   // what else tells rows apart
  std::vector<std::string> counts;   // the first two are a whole and its part, such as "released" and "missed"
  std::vector<std::string> figures;  // durations end with _ns
  std::vector<ResultRow> rows;       // a point's rows are consecutive; the last one is of all labels together
  std::uint64_t units = 0;           // of the plan
  std::uint64_t done = 0;
  std::vector<Remark> remarks;  // what was checked; not all good: the experiment found a mistake in redag

  [[nodiscard]] bool all_good() const;
};

/// Returns one row for each row: levels, labels, counts, and each figure with the ends of its interval. The same units
/// give the same bytes.
[[nodiscard]] std::string to_csv(const Results &results);
/// `plan` is the text of the plan. With the provenance of this process.
[[nodiscard]] std::string to_json(const Results &results, std::string_view plan);

}  // namespace redag::experiment
