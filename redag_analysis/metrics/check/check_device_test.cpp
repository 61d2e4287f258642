// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The rule for devices, on hand-written traces.
#include "redag_analysis/metrics/check/check_device.hpp"

#include <gtest/gtest.h>

#include "tests/testing/builders.hpp"
#include "tests/testing/expect_trace.hpp"
#include "tests/testing/trace_builder.hpp"

namespace redag::metrics {
namespace {

using testing::expect_broken;
using testing::expect_kept;
using testing::make_dag;
using testing::make_workload;
using testing::TraceBuilder;

// Each job executes for 1 ms, waits for the device for 2 ms, and executes for 1 ms.
Workload two_on_one_device(Device::Queue queue = Device::Queue::Priority) {
  Workload workload = make_workload({make_dag("a", {{"hi", 20, 2}}), make_dag("b", {{"lo", 40, 2}})}, 2);
  for (Dag &dag : workload.dags) {
    dag.tasks[0].waits = {Wait{kMillisecond, 2 * kMillisecond, 0, DeviceId(std::size_t{0})}};
  }
  workload.platform.devices = {Device{"gpu", 1, queue}};
  return workload;
}

// Both jobs ask the device at 1.
TraceBuilder both_ask(Device::Queue queue = Device::Queue::Priority) {
  TraceBuilder t(two_on_one_device(queue));
  t.at(0).arrives("hi", 0).arrives("lo", 0).dispatched("hi", 0, 0, 20).dispatched("lo", 0, 1, 40);
  return t;
}

TEST(CheckDevice, TheScheduleOfTheModelIsLawful) {
  TraceBuilder t = both_ask();
  t.at(1).waits("hi", 0, 0, 0).waits("lo", 0, 1, 0).served("hi", 0, 0);
  t.at(3).woken("hi", 0, 0).resumed("hi", 0, 0).served("lo", 0, 0);
  t.at(4).finished("hi", 0, 0);
  t.at(5).woken("lo", 0, 0).resumed("lo", 0, 1).at(6).finished("lo", 0, 1);
  expect_kept(t.until(10), Rule::Device);
}

TEST(CheckDevice, ALessUrgentJobMustNotBeServedFirst) {
  TraceBuilder t = both_ask();
  t.at(1).waits("hi", 0, 0, 0).waits("lo", 0, 1, 0).served("lo", 0, 0);
  expect_broken(t.until(2), Rule::Device);
}

TEST(CheckDevice, AFifoServesInTheOrderOfRequests) {
  TraceBuilder first = both_ask(Device::Queue::Fifo);
  first.at(1).waits("lo", 0, 1, 0).waits("hi", 0, 0, 0);
  TraceBuilder second = first;
  first.served("lo", 0, 0);
  EXPECT_EQ(check_trace(first.until(2)).violated(Rule::Device), 0U);
  second.served("hi", 0, 0);
  expect_broken(second.until(2), Rule::Device);
}

TEST(CheckDevice, ASlotServesOneJob) {
  TraceBuilder t = both_ask();
  t.at(1).waits("hi", 0, 0, 0).waits("lo", 0, 1, 0).served("hi", 0, 0).served("lo", 0, 0);
  expect_broken(t.until(2), Rule::Device);
}

TEST(CheckDevice, ADeviceIsNotIdleWhileAJobWaits) {
  TraceBuilder t = both_ask();
  t.at(1).waits("hi", 0, 0, 0).at(2).waits("lo", 0, 1, 0);
  expect_broken(t.until(3), Rule::Device);
}

TEST(CheckDevice, AWaitBeginsAndEndsWhenItsTaskSays) {
  TraceBuilder early(two_on_one_device());
  early.at(0).arrives("hi", 0).dispatched("hi", 0, 0, 20).waits("hi", 0, 0, 0).served("hi", 0, 0);
  expect_broken(early.until(1), Rule::Device);
  TraceBuilder t = both_ask();
  t.at(1).waits("hi", 0, 0, 0).served("hi", 0, 0).waits("lo", 0, 1, 0);
  TraceBuilder late = t;
  t.at(2).woken("hi", 0, 0);
  expect_broken(t.until(2), Rule::Device);
  expect_broken(late.until(3), Rule::Device);  // never woken
}

TEST(CheckDevice, AJobWaitsWhereItsTaskDoesAndAsOften) {
  TraceBuilder elsewhere = both_ask();
  elsewhere.at(1).waits("hi", 0, 0, -1);
  expect_broken(elsewhere.until(2), Rule::Device);
  TraceBuilder unknown = both_ask();
  unknown.at(1).waits("hi", 0, 0, 7);
  expect_broken(unknown.until(2), Rule::Device);
  TraceBuilder never(two_on_one_device());
  never.at(0).arrives("hi", 0).dispatched("hi", 0, 0, 20).at(2).finished("hi", 0, 0);
  expect_broken(never.until(3), Rule::Device);
}

TEST(CheckDevice, AWokenJobMayNotWaitForAFreeWorker) {
  TraceBuilder t = both_ask();
  t.at(1).waits("hi", 0, 0, 0).waits("lo", 0, 1, 0).served("hi", 0, 0).at(3).woken("hi", 0, 0).served("lo", 0, 0);
  expect_broken(t.until(4), Rule::WorkConservation);
}

TEST(CheckDevice, StatesFollowEachOther) {
  TraceBuilder t = both_ask();
  t.at(1).waits("hi", 0, 0, 0).waits("hi", 0, 0, 0);
  expect_broken(t.until(2), Rule::Life);
  TraceBuilder unasked = both_ask();
  unasked.at(1).served("hi", 0, 0);
  expect_broken(unasked.until(2), Rule::Life);
  TraceBuilder unserved = both_ask();
  unserved.at(1).waits("hi", 0, 0, 0).woken("hi", 0, 0);
  expect_broken(unserved.until(2), Rule::Life);
  TraceBuilder ended = both_ask();
  ended.at(1).waits("hi", 0, 0, 0).served("hi", 0, 0).finished("hi", 0, 0);
  expect_broken(ended.until(2), Rule::Life);
}

}  // namespace
}  // namespace redag::metrics
