// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Bounds for units alone, made to hold for units that wait for data of other rates. Waiting is release jitter of the
// unit that waits: a job that waits holds nothing, and never waits again once it is ready. So each method that knows
// jitter is applied anew with the waits that its own responses imply, until they agree. Pure functions.
// Proofs: docs/analysis.md, "Edges between rates".
#pragma once

#include <optional>
#include <string>

#include "redag_analysis/core/bound.hpp"

namespace redag::analysis {

/// Nothing, or what a method may not meet on its own: rate edges, or threads that suffice only if all is bounded.
[[nodiscard]] std::optional<std::string> why_not_directly(const System &system);

/// across_rates() does more than to apply: there are rate edges, few threads, or a max_active over several units.
[[nodiscard]] bool is_across_rates(const System &system);

/// `apply` on the system with waits as jitter and rate edges taken away. `apply` must bound responses by units, take
/// release jitter, and answer nothing for a unit whose jitter is at least its limit. A max_active of a DAG in several
/// parts, and few threads, are taken away too where most_jobs_in_progress() is within them; then all tasks concerned
/// are bounded or none is. Assumes timers that keep their periods: a source that pauses lets others wait for it.
/// A data task behind a rate edge is bounded from its own release, a timer task from its nominal one, a DAG from the
/// earliest origin of its data. At most a thousand applications.
[[nodiscard]] Outcome across_rates(const System &system, Outcome (*apply)(const System &system));

}  // namespace redag::analysis
