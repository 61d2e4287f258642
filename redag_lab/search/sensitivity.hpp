// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// How far execution times and rates can grow until the analysis no longer says "schedulable", or how far they have to
// shrink until it does. Searches positions of knobs (scaling.hpp), exact to one nanosecond or one millionth. Pure
// functions, but for the hooks of the caller.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "redag_analysis/analyze/analyze.hpp"
#include "redag_lab/search/scaling.hpp"

namespace redag::analysis {

/// How far one knob can be turned. Schedulability under bounds, and under schedulers with several workers, need not be
/// monotone, so this is what the tests show: `position` is accepted, the next one is not, and so is everything tested
/// below it (from the nominal position on, or, where that is not accepted, from the least load looked at).
struct Margin {
  Knob knob;
  std::int64_t nominal = 0;
  std::optional<std::int64_t> position;  // none: not accepted, however little load this knob leaves
  std::optional<std::int64_t> again;     // a position above it that is accepted too: not monotone
  std::uint32_t tested = 0;              // positions
  std::string obstacle;                  // what stands in the way at the next position: a clause without a period

  /// Load at `position` over the nominal load. Requires a position.
  double factor = 0;
};

/// Is this workload, compiled for the platform, good enough? Only asked of what why_impossible() lets pass.
using Accepts = std::function<bool(const Workload &, const System &)>;

/// analyze() calls it schedulable.
[[nodiscard]] inline bool accepted_by_analysis(const Workload & /*workload*/, const System &system) {
  return is_shown_schedulable(system);
}

struct SensitivityOptions {
  /// Positions between the nominal one and the first that cannot be met at all which are tested for monotonicity,
  /// evenly spread. Where periods decide on priorities, those at which the order changes are tested besides.
  std::uint32_t probes = 16;
  /// Asked before every test; true ends the search. Null: never.
  std::function<bool()> stop;
};

/// No schedule on this platform meets every deadline: some task's own execution is longer than what it has, or the
/// utilization is above the workers. The first that is so, in words; nothing if neither is.
[[nodiscard]] std::optional<std::string> why_impossible(const System &system);

/// One knob. Nothing if `stop` ended it. `workload` must be valid. Cost: about probes + log2(range) tests.
[[nodiscard]] std::optional<Margin> margin_of(const Workload &workload, const AnalysisPlatform &platform,
                                              const Knob &knob, const Accepts &accepts = accepted_by_analysis,
                                              const SensitivityOptions &options = {});

/// Every knob of a workload that people ask about, in the order of a report: all wcets, all rates; each task's wcet;
/// each DAG's rate, as a period where it has one; and the period of each unit of a DAG that has several units.
[[nodiscard]] std::vector<Knob> knobs_of(const Workload &workload, const System &system);

}  // namespace redag::analysis
