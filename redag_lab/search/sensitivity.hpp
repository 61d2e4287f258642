// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Finds how far execution times can grow until the analysis no longer says "schedulable", or how far they have to
// shrink until it does. Searches positions of knobs (scaling.hpp), exact to one nanosecond or one millionth. Pure
// functions, apart from the caller's hooks.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "redag_analysis/analyze/analyze.hpp"
#include "redag_lab/search/scaling.hpp"

namespace redag::lab {

/// The range of one knob, as far as it was tested. Schedulability under bounds, and under schedulers with several
/// workers, need not be monotone. `position` is accepted and the next position is not. Every tested position below is
/// accepted too, from the nominal one on or, where that is not accepted, from the least load tried.
struct Margin {
  Knob knob;
  std::int64_t nominal = 0;
  std::optional<std::int64_t> position;  // none: not accepted at any load that this knob leaves
  double factor = 0;                     // the load at `position` divided by the nominal load; 0: no position
  std::string obstacle;                  // what fails at the next position: a clause without a final full stop
};

/// True if this workload, compiled for the platform, is acceptable. Called only for workloads that why_impossible()
/// passes.
using Accepts = std::function<bool(const Workload &, const analysis::TaskSet &)>;

/// Accepts the workloads that analyze() calls schedulable.
[[nodiscard]] inline bool accepted_by_analysis(const Workload & /*workload*/, const analysis::TaskSet &task_set) {
  return analysis::is_shown_schedulable(task_set);
}

struct SensitivityOptions {
  /// The number of evenly spread positions that are tested before the bisection, because acceptance need not be
  /// monotone.
  std::uint32_t probes = 16;
  /// Called before every test; true ends the search. Null: never.
  std::function<bool()> stop;
};

/// Returns the first reason why no schedule on this platform meets every deadline; nothing if there is none. Either a
/// task's own execution exceeds its time, or the utilization exceeds the workers.
[[nodiscard]] std::optional<std::string> why_impossible(const analysis::TaskSet &task_set);

/// Finds the margin of one knob. Returns nothing if `stop` ended it. `workload` must be valid. Needs about
/// probes + log2(range) tests.
[[nodiscard]] std::optional<Margin> margin_of(const Workload &workload, const analysis::AnalysisPlatform &platform,
                                              const Knob &knob, const Accepts &accepts = accepted_by_analysis,
                                              const SensitivityOptions &options = {});

/// Returns the knobs of a report, in its order: all wcets, and each task's wcet.
[[nodiscard]] std::vector<Knob> knobs_of(const Workload &workload);

}  // namespace redag::lab
