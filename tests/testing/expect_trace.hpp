// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Expectations on the trace checker. A failure prints the report.
#pragma once

#include <gtest/gtest.h>

#include "redag_analysis/metrics/check/trace_checker.hpp"

namespace redag::testing {

/// Expects that the trace breaks `rule`. It may break other rules as a consequence.
inline void expect_broken(const trace::Trace &trace, metrics::Rule rule) {
  const metrics::CheckReport report = metrics::check_trace(trace);
  EXPECT_GT(report.violated(rule), 0U) << "expected: " << to_string(rule) << "\n" << report.to_string();
}

/// Expects that the trace breaks no rule, and that `rule` was tested.
inline void expect_kept(const trace::Trace &trace, metrics::Rule rule) {
  const metrics::CheckReport report = metrics::check_trace(trace);
  EXPECT_TRUE(report.ok()) << report.to_string();
  EXPECT_GT(report.checks(rule), 0U) << to_string(rule) << " was never tested";
}

}  // namespace redag::testing
