// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/executors/executors.hpp"

#include <gtest/gtest.h>

#include "tests/testing/builders.hpp"

namespace redag::executors {
namespace {

Workload two_timers() { return testing::make_workload({testing::tick_dag("d", {{"a", 100}, {"b", 10}})}); }

TEST(Executors, AreFoundByNameOursFirst) {
  EXPECT_EQ(all().front().name, "redag");
  for (const ExecutorKind &kind : all()) {
    EXPECT_EQ(find_executor(kind.name), &kind);
    EXPECT_FALSE(kind.description.empty());
  }
  EXPECT_EQ(find_executor("cfs"), nullptr);
}

TEST(Executors, AModelOfRclcppDoesNotPreempt) {
  const sched::Config config{4, sched::Preemption::Full, PolicyKind::RateMonotonic, 3, 8};
  const sched::Config mte = effective_config(*find_executor("mte"), config);
  EXPECT_EQ(mte.preemption, sched::Preemption::None);
  EXPECT_EQ(mte.workers, 4U);
  EXPECT_EQ(mte.levels + mte.max_started, 0U);
  EXPECT_EQ(effective_config(*find_executor("ste"), config).workers, 1U);
  EXPECT_EQ(effective_config(*find_executor("redag"), config).preemption, sched::Preemption::Full);
}

// The faster of two timers is the second one: only our executor considers the rates.
TEST(Executors, MakeSchedulersThatDifferInWhoIsFirst) {
  for (const ExecutorKind &kind : all()) {
    const auto scheduler = make_scheduler(kind.name, two_timers(), sched::Config{});
    scheduler->release(TaskId(0), 0, 0);
    scheduler->release(TaskId(1), 0, 0);
    const sched::Step step = scheduler->dispatch(0);
    ASSERT_EQ(step.dispatches.size(), 1U) << kind.name;
    EXPECT_EQ(step.dispatches[0].task, TaskId(kind.name == "redag" ? 1 : 0)) << kind.name;
  }
}

TEST(ExecutorsDeathTest, AnUnknownNameIsAMistakeOfTheCaller) {
  EXPECT_DEATH(static_cast<void>(make_scheduler("cfs", two_timers(), sched::Config{})),
               "there is no executor of this name");
}

}  // namespace
}  // namespace redag::executors
