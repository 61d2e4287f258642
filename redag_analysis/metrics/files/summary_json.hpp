// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Writes summary.json ("redag.summary/2"): everything in a Summary and the description of its run. Keys:
// docs/results_format.md. Pure except for the file.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

#include "redag/base/result.hpp"
#include "redag/trace/trace.hpp"
#include "redag_analysis/metrics/summary.hpp"

namespace redag::metrics {

// The parts of the document, for others.
[[nodiscard]] nlohmann::ordered_json to_json(const Distribution &distribution);
[[nodiscard]] nlohmann::ordered_json to_json(const JobCounts &jobs);
[[nodiscard]] nlohmann::ordered_json to_json(const EndToEnd &end_to_end);

/// The text is indented by two and ends with a line break; equal inputs give equal bytes.
[[nodiscard]] std::string summary_to_json(const Summary &summary, const trace::RunInfo &run);

[[nodiscard]] Result<void> write_summary(const std::string &path, const Summary &summary, const trace::RunInfo &run);

}  // namespace redag::metrics
