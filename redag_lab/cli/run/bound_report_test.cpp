// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/cli/run/bound_report.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/testing/builders.hpp"

namespace redag::cli {
namespace {

using redag::testing::make_dag;
using redag::testing::make_workload;
using ::testing::HasSubstr;
using ::testing::Not;

// Simulates 100 ms of the workload.
lab::Session simulated(const Workload &workload, const std::string &executor = "redag") {
  lab::SessionOptions options;
  options.duration = 100 * kMillisecond;
  return lab::run_session(workload, *lab::parse_variant(executor), options).value();
}

Duration bound_of(const lab::BoundCheck &check, std::size_t task) {
  return check.assumptions.tasks.at(task).response.bound;
}

Workload fast_and_slow() {
  return make_workload({make_dag("fast", {{.name = "imu", .period = 10, .wcet = 2}}),
                        make_dag("slow", {{.name = "plan", .period = 50, .wcet = 20}})},
                       1, PreemptionMode::Os);
}

TEST(BoundCheck, ARunWithinItsBounds) {
  const lab::BoundCheck check = lab::check_bounds(simulated(fast_and_slow()));
  ASSERT_EQ(check.assumptions.tasks.size(), 2U);
  EXPECT_EQ(check.bounded, 2U);
  EXPECT_EQ(check.absent, "");
  EXPECT_EQ(check.names[0], "fast.imu");
  EXPECT_EQ(bound_of(check, 0), 2 * kMillisecond);
  EXPECT_EQ(bound_of(check, 1), 26 * kMillisecond);
  EXPECT_TRUE(check.remarks.empty());
  const std::string text = describe(check, 2, StreamTraits{});
  EXPECT_THAT(
      text,
      HasSubstr(
          "2 of 2 tasks have a bound; no response time was above its bound, no execution time was above its wcet"));
  EXPECT_THAT(text, HasSubstr("overheads of the platform are not charged"));
}

TEST(BoundCheck, ChargesTheOverheadsOfTheRun) {
  lab::Session session = simulated(fast_and_slow());
  Overheads machine;
  machine.dispatch = kMillisecond;
  machine.lateness = kMillisecond;
  session.info.overheads = to_string(machine);
  const lab::BoundCheck check = lab::check_bounds(session);
  EXPECT_EQ(bound_of(check, 0), 4 * kMillisecond);
  const std::string text = describe(check, 2, StreamTraits{});
  EXPECT_THAT(text, HasSubstr("with the machine's overheads charged"));
  EXPECT_THAT(text, Not(HasSubstr("not charged")));
}

// The bounds are those of the executor that ran: 20 + 2 ms for both tasks, without regard to our priorities.
TEST(BoundCheck, ARunOfAnotherExecutor) {
  Workload workload = fast_and_slow();
  workload.dags[0].tasks[0].period = workload.dags[0].tasks[0].deadline = 50 * kMillisecond;
  for (const char *executor : {"ste", "events"}) {
    const lab::BoundCheck check = lab::check_bounds(simulated(workload, executor));
    EXPECT_EQ(check.bounded, 2U) << executor << ": " << check.absent;
    EXPECT_EQ(bound_of(check, 0), 22 * kMillisecond) << executor;
    EXPECT_TRUE(check.remarks.empty()) << executor;
  }
}

// Jobs executed longer than the wcet of the bounds. Both tasks respond late, the second because of the first.
TEST(BoundCheck, NamesWhatIsBroken) {
  lab::Session session = simulated(fast_and_slow());
  Task &imu = session.info.workload.dags[0].tasks[0];
  imu.wcet = imu.bcet = kMillisecond;
  const lab::BoundCheck check = lab::check_bounds(session);
  const metrics::TaskCheck &fast = check.assumptions.tasks.at(0);
  const metrics::TaskCheck &slow = check.assumptions.tasks.at(1);
  EXPECT_EQ(fast.response.exceeded, 10U);
  EXPECT_EQ(fast.response.worst, 2 * kMillisecond);
  EXPECT_TRUE(fast.execution.is_exceeded);
  EXPECT_EQ(slow.response.exceeded, 2U);
  EXPECT_EQ(slow.response.broken, metrics::Broken::Wcet);
  EXPECT_EQ(slow.response.task, TaskId(0)) << "the other one's wcet broke";
  EXPECT_FALSE(slow.execution.is_exceeded);
  const std::string text = describe(check, 2, StreamTraits{});
  EXPECT_THAT(text, HasSubstr("alarm: fast.imu: wcet exceeded: 2ms of processor time, 10 of 10 executions exceeded the "
                              "wcet of 1ms\n"));
  EXPECT_THAT(text,
              HasSubstr("alarm: slow.plan: 2 responses exceeded the bound of 23ms, the longest is 26ms; wcet exceeded: "
                        "fast.imu used 2ms of processor time\n"));
  EXPECT_EQ(to_json(check)["tasks"][1]["cause"], "wcet");
  EXPECT_EQ(to_json(check)["tasks"][1]["exceeded"], 2);
}

TEST(BoundCheck, SaysWhyThereIsNone) {
  lab::Session session = simulated(fast_and_slow());
  session.info.workload.dags[0].tasks[0].wcet = 20 * kMillisecond;  // of 10: no time is left for the other task
  const lab::BoundCheck check = lab::check_bounds(session);
  EXPECT_EQ(check.bounded, 1U);
  EXPECT_THAT(describe(check, 2, StreamTraits{}), HasSubstr("1 of 2 tasks have a bound (slow.plan: "));
}

}  // namespace
}  // namespace redag::cli
