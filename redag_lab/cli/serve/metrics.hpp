// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The figures of live pages as metrics, in the text format that Prometheus scrapes (version 0.0.4). Pure functions.
#pragma once

#include <string>
#include <vector>

#include "redag/base/time.hpp"
#include "redag/live/reader.hpp"

namespace redag::cli {

/// Times are in seconds. docs/live_page.md lists the metrics.
[[nodiscard]] std::string metrics_text(const std::vector<live::Listed> &pages, Time now);

}  // namespace redag::cli
