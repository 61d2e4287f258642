// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Explanations (why.hpp) in words, for the terminal and the report. Pure functions.
#pragma once

#include <string>

#include "redag/model/workload.hpp"
#include "redag_analysis/metrics/why/why.hpp"

namespace redag::metrics {

/// For example "control.ekf#12".
[[nodiscard]] std::string job_name(const Workload &workload, const JobId &job);

/// For example "queued behind perception.detect#3 (10 Hz)". Says whose time it was if not that of `explained`.
[[nodiscard]] std::string describe(const Part &part, const Workload &workload, const JobId &explained);

/// As above; of several parts for example "63 shorter parts, mainly queued behind perception.detect (1.2ms)".
[[nodiscard]] std::string describe(const PartRow &row, const Workload &workload, const JobId &explained);

/// The name of the task that delayed jobs; empty: none is known.
[[nodiscard]] std::string name_of(const Culprit &culprit, const Workload &workload);

/// For example "queued behind perception.detect", of the culprit with that name.
[[nodiscard]] std::string describe(Cause cause, const std::string &name);
[[nodiscard]] std::string describe(const Culprit &culprit, const Workload &workload);

/// The same of several culprits, with their jobs: "queued behind perception.detect (12), log.flush (2) and 1 other".
[[nodiscard]] std::string describe(const MainCause &main, const Workload &workload);

/// For example "control.ekf#12 missed its deadline of 5ms by 1.2ms".
[[nodiscard]] std::string headline(const Explanation &explanation, const Workload &workload);

}  // namespace redag::metrics
