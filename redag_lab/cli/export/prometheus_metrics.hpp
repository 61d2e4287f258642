// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Live pages as Prometheus's metrics (docs/prometheus.md). Times are in seconds, and counters begin with the executor.
// Pure functions.
#pragma once

#include <prometheus/metric_family.h>

#include <vector>

#include "redag/base/time.hpp"
#include "redag/live/reader.hpp"

namespace redag::cli {

/// `now` is CLOCK_MONOTONIC. Pages that cannot be read are counted.
[[nodiscard]] std::vector<prometheus::MetricFamily> metrics_of(const std::vector<live::Listed> &pages, Time now);

}  // namespace redag::cli
