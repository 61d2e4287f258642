// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/metrics/response_split.hpp"

#include <gtest/gtest.h>

#include "redag_analysis/metrics/jobs.hpp"
#include "tests/testing/builders.hpp"
#include "tests/testing/trace_builder.hpp"

namespace redag::metrics {
namespace {

using testing::make_dag;
using testing::make_workload;
using testing::TraceBuilder;

ResponseSplit in_ms(Duration not_ready, Duration ready, Duration on_worker, Duration preempted, Duration device_queue,
                    Duration device, Duration waits) {
  ResponseSplit split;
  split.length = {not_ready, ready, on_worker, preempted, device_queue, device, waits};
  for (Duration &length : split.length) length *= kMillisecond;
  return split;
}

TEST(ResponseSplit, FollowsAJobFromItsReleaseToItsEnd) {
  TraceBuilder t(make_workload({make_dag("a", {{"t", 100}})}, 1, PreemptionMode::Os));
  t.at(2).released_for("t", 0, 0).at(3).ready("t", 0, 0);                            // 3 ms not ready
  t.at(7).dispatched("t", 0, 0, 100).at(8).started("t", 0, 0);                       // 4 ms ready
  t.at(12).preempted("t", 0, 0).at(18).resumed("t", 0, 0);                           // 5 ms, and preempted for 6 ms
  t.at(19).waits("t", 0, 0, 0).at(26).served("t", 0, 0).at(34).woken("t", 0, 0);     // 1 ms; queued 7 ms, served 8 ms
  t.at(36).resumed("t", 0, 0).at(37).waits("t", 0, 0, -1).at(46).woken("t", 0, -1);  // ready 2 ms, 1 ms, waits 9 ms
  t.at(46).resumed("t", 0, 0).at(50).finished("t", 0, 0);                            // 4 ms
  const trace::Trace trace = t.until(60);
  const std::vector<JobRecord> jobs = fold_jobs(trace.info.workload, trace.events);
  ASSERT_EQ(jobs.size(), 1U);
  EXPECT_EQ(jobs[0].split, in_ms(3, 6, 11, 6, 7, 8, 9));
  EXPECT_EQ(jobs[0].split.sum(), jobs[0].response());
  EXPECT_EQ(jobs[0].split[Stay::OnWorker], jobs[0].on_worker);
}

// On threads a body can end before the decision to preempt it.
TEST(ResponseSplit, IsExactWhereTheEndPrecedesAnEvent) {
  StayClock clock(0);
  clock.move(Stay::Ready, 10);
  clock.move(Stay::OnWorker, 20);
  clock.move(Stay::Preempted, 50);
  clock.end(47);
  EXPECT_EQ(clock.split().sum(), 47);
  EXPECT_EQ(clock.split()[Stay::OnWorker], 27);
  EXPECT_EQ(clock.split()[Stay::Preempted], 0);

  StayClock out_of_order(5);
  out_of_order.move(Stay::Ready, 3);
  out_of_order.move(Stay::OnWorker, 9);
  out_of_order.move(Stay::Waits, 8);
  out_of_order.end(11);
  EXPECT_EQ(out_of_order.split().sum(), 6);
  EXPECT_EQ(out_of_order.split()[Stay::Ready], 4);
  EXPECT_EQ(out_of_order.split()[Stay::Waits], 2);
}

TEST(ResponseSplits, KeepTheLongestOneAndTheSum) {
  ResponseSplits first;
  first.add(in_ms(0, 1, 2, 0, 0, 0, 0));
  first.add(in_ms(0, 0, 2, 0, 5, 1, 0));
  first.add(in_ms(0, 4, 2, 0, 0, 0, 0));
  EXPECT_EQ(first.total, in_ms(0, 5, 6, 0, 5, 1, 0));
  EXPECT_EQ(first.longest, in_ms(0, 0, 2, 0, 5, 1, 0));
  ResponseSplits second;
  second.add(ResponseSplits{});
  EXPECT_EQ(second.jobs, 0U);
  second.add(in_ms(0, 0, 2, 9, 0, 0, 0));
  first.add(second);
  EXPECT_EQ(first.jobs, 4U);
  EXPECT_EQ(first.longest, in_ms(0, 0, 2, 9, 0, 0, 0));
  EXPECT_EQ(first.total.sum(), (3 + 8 + 6 + 11) * kMillisecond);
}

}  // namespace
}  // namespace redag::metrics
