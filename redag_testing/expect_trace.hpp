// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// What a test expects of the trace checker. A failure prints the report.
#pragma once

#include <gtest/gtest.h>

#include "redag_analysis/metrics/trace_checker.hpp"

namespace redag::testing {

/// The trace breaks `rule`; what else it breaks as a consequence does not matter.
inline void expect_broken(const trace::Trace &trace, metrics::Rule rule) {
  const metrics::CheckReport report = metrics::check_trace(trace);
  EXPECT_GT(report.violated(rule), 0U) << "expected: " << to_string(rule) << "\n" << report.to_string();
}

/// The trace breaks nothing, and `rule` was put to the test.
inline void expect_kept(const trace::Trace &trace, metrics::Rule rule) {
  const metrics::CheckReport report = metrics::check_trace(trace);
  EXPECT_TRUE(report.ok()) << report.to_string();
  EXPECT_GT(report.checks(rule), 0U) << to_string(rule) << " was never tested";
}

}  // namespace redag::testing
