// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Finds recorded runs in result folders: which runs exist, which are repetitions of one another, and their labels.
// Reads names and comparison.json, but no trace. Not thread-safe.
#pragma once

#include <string>
#include <vector>

#include "redag/base/result.hpp"
#include "redag/trace/trace.hpp"
#include "redag_lab/cli/terminal/console.hpp"

namespace redag::cli {

/// Repetitions of one run, such as `<place>/mte/repetition-1` and `<place>/mte/repetition-2`, or a single run.
struct RecordedRuns {
  std::string label;                // shortest unique end of the path: "mte", "before/mte"
  std::vector<std::string> traces;  // paths of events.redag
};

struct RecordedPlaces {
  std::vector<RecordedRuns> runs;  // in the order of `places`; executors of a comparison as it lists them
  std::vector<std::string> notes;  // warnings of comparisons
  [[nodiscard]] std::size_t traces() const;
};

/// Searches `places`: folders, or events.redag files. A run found twice counts once. Errors: a place without a trace,
/// or a malformed comparison.json.
[[nodiscard]] Result<RecordedPlaces> find_recorded_runs(const std::vector<std::string> &places);

struct ChosenRun {
  std::string file;  // its events
  std::string note;  // which one it is, and why; empty: there is no other
};

/// Chooses one run. Of repetitions it is the one that missed most deadlines, and of a comparison one of the executor
/// that it names first. Error: there is no run, or there are several of which none is meant more than the others.
[[nodiscard]] Result<ChosenRun> choose_run(const std::string &place);

/// Warns of what observers noticed during a run, for example that it was killed before its record was complete.
void warn_of_remarks(const trace::RunInfo &run, Console &console);

}  // namespace redag::cli
