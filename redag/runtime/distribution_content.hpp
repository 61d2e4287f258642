// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Makes the Distributions of the interface from the histograms of the engine. Pure functions.
#pragma once

#include <memory>

#include "redag/base/histogram.hpp"
#include "redag/runtime/stats.hpp"

namespace redag::runtime {

struct Distribution::Content {
  HistogramCounts counts;
};

/// The present content of a histogram; empty for null.
[[nodiscard]] inline Distribution distribution_of(const Histogram *histogram) {
  if (histogram == nullptr) return {};
  return Distribution(std::make_shared<const Distribution::Content>(Distribution::Content{histogram->counts()}));
}

}  // namespace redag::runtime
