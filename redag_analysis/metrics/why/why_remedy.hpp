// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Says what to change against a cause of misses (why.hpp). The one place of remedies: the terminal, the report and the
// table of docs/why.md read them here. Pure functions.
#pragma once

#include <string>

#include "redag/trace/trace.hpp"
#include "redag_analysis/metrics/why/why.hpp"

namespace redag::metrics {

/// Returns the remedy of a run's main cause, with names and numbers: "camera.detect delayed control.imu by up to 5ms:
/// let it give way ...". Considers how the run was executed.
[[nodiscard]] std::string remedy(const MainCause &main, const trace::RunInfo &run);
[[nodiscard]] std::string remedy(const Culprit &culprit, const trace::RunInfo &run);

/// The same in general, for tables of all causes: "let X give way ...". Empty for Cause::Removed.
[[nodiscard]] std::string remedy(Cause cause);

}  // namespace redag::metrics
