// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/one_worker/exact_points.hpp"

#include <gtest/gtest.h>

#include "redag_analysis/one_worker/linear_bound.hpp"
#include "redag_testing/bound_property.hpp"

namespace redag::analysis {
namespace {

using testing::BoundCaseLimits;

testing::BoundGenerator cases(double max_deadline, bool edges) {
  BoundCaseLimits limits;
  limits.groups = limits.levels = limits.overheads = limits.caps = limits.queues = true;
  limits.max_deadline = max_deadline;
  limits.edges = edges;
  return [limits](Rng &rng) { return testing::random_bound_case(rng, limits); };
}

const testing::BoundPropertyOptions kFew{.workloads = 250};

TEST(BoundProperty, PointsTest) { expect_bound_holds(exact_points(), cases(1.0, false), kFew); }
TEST(BoundProperty, PointsTestOnDags) { expect_bound_holds(exact_points(), cases(1.0, true), kFew); }
TEST(BoundProperty, LinearBound) { expect_bound_holds(linear_bound(), cases(2.5, false), kFew); }
TEST(BoundProperty, LinearBoundOnDags) { expect_bound_holds(linear_bound(), cases(1.0, true), kFew); }

}  // namespace
}  // namespace redag::analysis
