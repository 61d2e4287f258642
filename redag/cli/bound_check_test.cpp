#include "redag/cli/bound_check.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "redag/testing/timeline.hpp"

namespace redag::cli {
namespace {

using redag::testing::make_dag;
using redag::testing::make_workload;
using ::testing::HasSubstr;
using ::testing::Not;

// 100 ms of it, in virtual time.
Session simulated(const Workload &workload, const std::string &executor = "redag") {
  SessionOptions options;
  options.duration = 100 * kMillisecond;
  return run_session(workload, *parse_variant(executor), options).value();
}

Workload fast_and_slow() {
  return make_workload({make_dag("fast", {{.name = "imu", .period_ms = 10, .wcet_ms = 2}}),
                        make_dag("slow", {{.name = "plan", .period_ms = 50, .wcet_ms = 20}})},
                       1, PreemptionMode::Os);
}

TEST(BoundCheck, ARunWithinItsBounds) {
  const BoundCheck check = check_bounds(simulated(fast_and_slow()));
  ASSERT_EQ(check.rows.size(), 2U);
  EXPECT_EQ(check.bounded, 2U);
  EXPECT_EQ(check.absent, "");
  EXPECT_EQ(check.rows[0].name, "fast.imu");
  EXPECT_EQ(check.rows[0].bound, 2 * kMillisecond);
  EXPECT_EQ(check.rows[1].bound, 26 * kMillisecond);
  EXPECT_FALSE(check.rows[0].is_broken() || check.rows[1].is_broken());
  EXPECT_THAT(describe(check, 2, StreamTraits{}),
              HasSubstr("2 of 2 tasks have one; no response was above its bound, no execution above its wcet"));
}

// Against what is known of the executor that ran: 20 + 2 ms for both, and nothing that our priorities would promise.
TEST(BoundCheck, ARunOfAnotherExecutor) {
  Workload workload = fast_and_slow();
  workload.dags[0].tasks[0].period = workload.dags[0].tasks[0].deadline = 50 * kMillisecond;
  for (const char *executor : {"ste", "events"}) {
    const BoundCheck check = check_bounds(simulated(workload, executor));
    EXPECT_EQ(check.bounded, 2U) << executor << ": " << check.absent;
    EXPECT_EQ(check.rows.at(0).bound, 22 * kMillisecond) << executor;
    EXPECT_FALSE(check.rows.at(0).is_broken() || check.rows.at(1).is_broken()) << executor;
  }
}

// Jobs executed for longer than what the bounds are told: both tasks answer too late, the second because of the first.
TEST(BoundCheck, NamesWhatIsBroken) {
  Session session = simulated(fast_and_slow());
  Task &imu = session.info.workload.dags[0].tasks[0];
  imu.wcet = imu.bcet = kMillisecond;
  const BoundCheck check = check_bounds(session);
  ASSERT_EQ(check.rows.size(), 2U);
  EXPECT_EQ(check.rows[0].exceeded, 10U);
  EXPECT_EQ(check.rows[0].worst, 2 * kMillisecond);
  EXPECT_EQ(check.rows[0].on_worker, 2 * kMillisecond);
  EXPECT_EQ(check.rows[1].exceeded, 2U);
  EXPECT_EQ(check.rows[1].on_worker, 0);
  const std::string text = describe(check, 2, StreamTraits{});
  EXPECT_THAT(text,
              HasSubstr("fast.imu: 10 of its responses are above the bound of 1ms (rta_preemptive), the longest"));
  EXPECT_THAT(text, HasSubstr("fast.imu: held its worker for up to 2ms, its wcet is 1ms"));
  EXPECT_THAT(text, Not(HasSubstr("slow.plan: held")));
  EXPECT_EQ(to_json(check)["tasks"][1]["exceeded"], 2);
}

TEST(BoundCheck, SaysWhyThereIsNone) {
  Session session = simulated(fast_and_slow());
  session.info.workload.dags[1].tasks[0].wcet = 60 * kMillisecond;
  const BoundCheck check = check_bounds(session);
  EXPECT_EQ(check.bounded, 1U);
  EXPECT_THAT(describe(check, 2, StreamTraits{}), HasSubstr("1 of 2 tasks have one (slow.plan: "));
}

}  // namespace
}  // namespace redag::cli
