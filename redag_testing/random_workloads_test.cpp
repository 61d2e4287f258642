// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_testing/random_workloads.hpp"

#include <set>

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include "redag/model/validate.hpp"

namespace redag::testing {
namespace {

RC_GTEST_PROP(RandomWorkload, IsValid, ()) {
  const Workload workload = *any_workload();
  const Diagnostics diagnostics = validate(workload);
  if (has_errors(diagnostics)) RC_FAIL(to_string(diagnostics));
}

// Each of the shapes that make these workloads useful occurs within a hundred of them.
TEST(RandomWorkloads, HaveEveryShape) {
  std::set<std::string> seen;
  for (std::uint64_t seed = 0; seed < 100; ++seed) {
    Rng rng(seed);
    for (const Dag &dag : random_workload(rng).dags) {
      if (dag.max_active == 1) seen.insert("bound of one");
      if (dag.max_pending == 1) seen.insert("one pending");
      for (const Task &task : dag.tasks) {
        if (task.activation == Activation::Data && task.predecessors.size() > 1) seen.insert("join");
        if (task.activation == Activation::Timer && !task.predecessors.empty()) seen.insert("timer with predecessor");
        if (!task.group.empty()) seen.insert("group");
        if (task.overrun == Overrun::Queue) seen.insert("queue");
        if (task.offset > 0) seen.insert("offset");
        for (const std::uint32_t p : task.predecessors) {
          if (dag.tasks[p].period != task.period) seen.insert("edge between rates");
          if (&dag.tasks[p] > &task) seen.insert("edge against the order of the file");
        }
      }
    }
  }
  EXPECT_EQ(seen.size(), 9U);
}

TEST(RandomWorkloads, LimitsAreKept) {
  for (std::uint64_t seed = 0; seed < 200; ++seed) {
    Rng rng(seed);
    RandomWorkloadLimits limits{2, 3, false, false, false};
    const Workload workload = random_workload(rng, limits);
    EXPECT_LE(workload.dags.size(), 2U);
    for (const Dag &dag : workload.dags) {
      EXPECT_LE(dag.tasks.size(), 3U);
      EXPECT_EQ(dag.max_active + dag.max_pending, 0U);
      for (const Task &task : dag.tasks) {
        EXPECT_TRUE(task.group.empty());
        EXPECT_EQ(task.overrun, Overrun::Skip);
        EXPECT_EQ(task.activation, Activation::Timer);
      }
    }
  }
}

}  // namespace
}  // namespace redag::testing
