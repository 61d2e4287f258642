// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Result folders as a report sees them: which runs lie there, which are repetitions of one another, and what to call
// them. Reads names and comparison.json, no trace. Not thread-safe.
#pragma once

#include <string>
#include <vector>

#include "redag/base/result.hpp"

namespace redag::cli {

/// Repetitions of one thing: `<place>/mte/repetition-1`, `<place>/mte/repetition-2`, or a single run.
struct RecordedRuns {
  std::string label;                // shortest end of the path that tells it from the others: "mte", "before/mte"
  std::vector<std::string> traces;  // paths of events.jsonl
};

struct RecordedPlaces {
  std::vector<RecordedRuns> runs;  // in the order of `places`; executors of a comparison as it lists them
  std::vector<std::string> notes;  // what comparisons warn of
  [[nodiscard]] std::size_t traces() const;
};

/// `places`: folders, or events.jsonl files. A run found twice counts once. Errors: a place without a trace, a
/// comparison.json that is not one.
[[nodiscard]] Result<RecordedPlaces> find_recorded_runs(const std::vector<std::string> &places);

}  // namespace redag::cli
