// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/experiment/acceptance.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "redag/loader/workload_yaml.hpp"

namespace redag::experiment {
namespace {

bool miss_of(const std::string &text, SimulationEffort effort = {}) {
  const Result<LoadedWorkload> loaded = parse_workload(text, "test.yaml");
  EXPECT_TRUE(loaded) << to_string(loaded.error());
  const auto task_set = analysis::compile(loaded->workload, analysis::platform_of(loaded->workload));
  EXPECT_TRUE(task_set);
  return sees_miss(loaded->workload, *task_set, effort, 1);
}

std::string workload(const std::string &dags, const std::string &preemption = "os") {
  return "name: w\nplatform: {workers: 1, preemption: " + preemption + "}\ndags:\n" + dags;
}

TEST(SimulatedMisses, NoneWhereEverythingFits) {
  EXPECT_FALSE(
      miss_of(workload("  - {name: a, tasks: [{name: t, wcet: 5ms, period: 10ms}]}\n"
                       "  - {name: b, tasks: [{name: t, wcet: 10ms, period: 20ms}]}\n")));
}

TEST(SimulatedMisses, LateJob) {
  const auto miss =
      miss_of(workload("  - {name: a, tasks: [{name: t, wcet: 5ms, period: 10ms}]}\n"
                       "  - {name: b, tasks: [{name: t, wcet: 6ms, period: 20ms, deadline: 15ms}]}\n"));
  EXPECT_TRUE(miss);
}

TEST(SimulatedMisses, ExecutesForTheWcet) {
  EXPECT_TRUE(
      miss_of(workload("  - {name: a, tasks: [{name: t, wcet: 8ms, bcet: 1us, period: 10ms, deadline: 8ms}]}\n"
                       "  - {name: b, tasks: [{name: t, wcet: 2ms, bcet: 1us, period: 9ms}]}\n")));
}

TEST(SimulatedMisses, SkippedJob) {
  const auto miss = miss_of(workload("  - {name: a, tasks: [{name: t, wcet: 25ms, period: 100ms}]}\n"
                                     "  - {name: b, tasks: [{name: t, wcet: 1ms, period: 10ms}]}\n",
                                     "none"),
                            {5, 5});
  EXPECT_TRUE(miss);
}

// Released together, the urgent task runs first and no job misses. Only other offsets reveal the miss.
TEST(SimulatedMisses, RandomOffsetsSeeMore) {
  const std::string text = workload(
      "  - {name: a, tasks: [{name: t, wcet: 60ms, period: 100ms}]}\n"
      "  - {name: b, tasks: [{name: t, wcet: 1ms, period: 100ms, deadline: 30ms}]}\n"
      "policy: deadline_monotonic\n",
      "none");
  EXPECT_FALSE(miss_of(text, {0, 5}));
  EXPECT_TRUE(miss_of(text, {20, 5}));
}

TEST(SimulatedMisses, EndToEndDeadline) {
  const std::string dag =
      "  - {name: a, deadline: DEADLINE, tasks: [{name: s, wcet: 5ms, period: 20ms},"
      " {name: d, wcet: 5ms, activation: data, after: [s]}]}\n";
  const auto with = [&](const char *deadline) {
    std::string text = dag;
    text.replace(text.find("DEADLINE"), 8, deadline);
    return miss_of(workload(text));
  };
  EXPECT_FALSE(with("10ms"));
  EXPECT_TRUE(with("9ms"));
}

TEST(SimulatedMisses, UnfinishedAtTheEnd) {
  // The run lasts one period, and the late job has not ended by then.
  const auto miss = miss_of(workload("  - {name: a, tasks: [{name: t, wcet: 9ms, period: 10ms}]}\n"
                                     "  - {name: b, tasks: [{name: t, wcet: 8ms, period: 40ms, deadline: 10ms}]}\n"),
                            {0, 1});
  EXPECT_TRUE(miss);
}

}  // namespace
}  // namespace redag::experiment
