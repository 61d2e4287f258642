// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/analyze/admission.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/testing/builders.hpp"

namespace redag::analysis {
namespace {

using ::testing::HasSubstr;
using testing::make_dag;
using testing::make_workload;

sched::Config preemptive(std::uint32_t workers) {
  sched::Config config;
  config.workers = workers;
  config.preemption = sched::Preemption::Full;
  return config;
}

TEST(Admission, WhatFitsIsAdmitted) {
  const Workload workload =
      make_workload({make_dag("a", {{"t", 10, 4}}), make_dag("b", {{"u", 20, 8}})}, 1, PreemptionMode::Os);
  EXPECT_TRUE(admit_by_bounds(workload, preemptive(1)));
}

TEST(Admission, WhatDoesNotIsNamed) {
  const Workload workload =
      make_workload({make_dag("a", {{"t", 10, 4}}), make_dag("b", {{"u", 20, 13}})}, 1, PreemptionMode::Os);
  const Result<void> admitted = admit_by_bounds(workload, preemptive(1));
  ASSERT_FALSE(admitted);
  EXPECT_THAT(to_string(admitted.error()), HasSubstr("b.u"));
  EXPECT_THAT(to_string(admitted.error()), Not(HasSubstr("a.t"))) << "the more urgent one is not in doubt";
  EXPECT_TRUE(admit_by_bounds(workload, preemptive(2)));
}

TEST(Admission, WithoutAWcetNothingIsKnown) {
  Workload workload = make_workload({make_dag("a", {{"t", 10, 4}})}, 1, PreemptionMode::Os);
  workload.dags[0].tasks[0].wcet = 0;
  EXPECT_THAT(to_string(admit_by_bounds(workload, preemptive(1)).error()), HasSubstr("no wcet"));
}

}  // namespace
}  // namespace redag::analysis
