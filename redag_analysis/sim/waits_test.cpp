// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Schedules of jobs that wait without a worker (docs/model.md, "Waits"), written out by hand. "~" stands for a wait.
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "tests/testing/builders.hpp"
#include "tests/testing/timeline.hpp"

namespace redag::sim {
namespace {

using redag::testing::make_dag;
using redag::testing::make_workload;
using redag::testing::simulate_events;
using redag::testing::TestTask;
using redag::testing::timeline;
constexpr Duration kMs = kMillisecond;

Wait on(std::size_t device, Duration after, Duration length) {
  return Wait{after * kMs, length * kMs, 0, DeviceId(device)};
}
Wait elsewhere(Duration after, Duration length) { return Wait{after * kMs, length * kMs, 0, {}}; }

// One DAG for each task, which has these waits. Device 0 has one slot.
struct Waiting {
  TestTask task;
  std::vector<Wait> waits = {};
};
Workload waiting(const std::vector<Waiting> &tasks, std::uint32_t workers = 1,
                 PreemptionMode mode = PreemptionMode::None, Device::Queue queue = Device::Queue::Priority) {
  std::vector<Dag> dags;
  for (const Waiting &one : tasks) {
    dags.push_back(make_dag(one.task.name, {one.task}));
    dags.back().tasks[0].waits = one.waits;
  }
  Workload workload = make_workload(dags, workers, mode);
  workload.platform.devices = {Device{"gpu", 1, queue}};
  return workload;
}

std::string run(const Workload &workload, Time until) {
  return timeline(workload, simulate_events(workload, until * kMs));
}

TEST(WaitingJobs, LeaveTheirWorkerToTheNextJobAtOnce) {
  const Workload workload =
      waiting({{{.name = "a", .period = 20, .wcet = 3}, {elsewhere(1, 4)}}, {{.name = "b", .period = 30, .wcet = 2}}});
  EXPECT_EQ(run(workload, 20),
            "a#0 w0 0-1 ~ w0 5-7\n"
            "b#0 w0 1-3\n");
}

// Without preemption, a woken job waits for the end of a less urgent one, as a ready one would.
TEST(WaitingJobs, WaitForAWorkerOnceTheyAreWoken) {
  const std::vector<Waiting> tasks = {{{.name = "a", .period = 20, .wcet = 3}, {elsewhere(1, 2)}},
                                      {{.name = "b", .period = 30, .wcet = 6}}};
  EXPECT_EQ(run(waiting(tasks), 20), "a#0 w0 0-1 ~ w0 7-9\nb#0 w0 1-7\n");
  EXPECT_EQ(run(waiting(tasks, 1, PreemptionMode::Os), 20), "a#0 w0 0-1 ~ w0 3-5\nb#0 w0 1-3 w0 5-9\n");
}

// b became ready before c, and is as urgent: a woken job keeps its place in the order of jobs.
TEST(WaitingJobs, KeepTheirPlaceInTheOrder) {
  const Workload workload = waiting({{{.name = "b", .period = 20, .wcet = 2}, {elsewhere(1, 2)}},
                                     {{.name = "x", .period = 20, .wcet = 3, .offset = 1}},
                                     {{.name = "c", .period = 20, .wcet = 1, .offset = 2}}});
  EXPECT_EQ(run(workload, 20), "b#0 w0 0-1 ~ w0 4-5\nx#0 w0 1-4\nc#0 w0 5-6\n");
}

const std::vector<Waiting> kThreeOnOneDevice = {{{.name = "hi", .period = 20, .wcet = 2, .offset = 2}, {on(0, 1, 2)}},
                                                {{.name = "mid", .period = 30, .wcet = 2, .offset = 1}, {on(0, 1, 3)}},
                                                {{.name = "lo", .period = 40, .wcet = 2}, {on(0, 1, 5)}}};

// lo is served from 1 to 6 and not interrupted; mid asks at 2, hi at 3.
TEST(Devices, ServeTheMostUrgentJobFirst) {
  EXPECT_EQ(run(waiting(kThreeOnOneDevice, 3), 20),
            "lo#0 w0 0-1 ~ w0 6-7\n"
            "mid#0 w0 1-2 ~ w0 11-12\n"
            "hi#0 w0 2-3 ~ w0 8-9\n");
}

TEST(Devices, WithAFifoServeTheJobThatAskedFirst) {
  EXPECT_EQ(run(waiting(kThreeOnOneDevice, 3, PreemptionMode::None, Device::Queue::Fifo), 20),
            "lo#0 w0 0-1 ~ w0 6-7\n"
            "mid#0 w0 1-2 ~ w0 9-10\n"
            "hi#0 w0 2-3 ~ w0 11-12\n");
}

TEST(Devices, ServeOneJobInEachSlot) {
  Workload workload = waiting(kThreeOnOneDevice, 3);
  workload.platform.devices[0].slots = 3;
  EXPECT_EQ(run(workload, 20),
            "lo#0 w0 0-1 ~ w0 6-7\n"
            "mid#0 w0 1-2 ~ w1 5-6\n"
            "hi#0 w0 2-3 ~ w0 5-6\n");
}

// Both ask at 1, and the decision comes after both: the order of reports does not matter.
TEST(Devices, DecideOverAllThatAskAtOneInstant) {
  const Workload workload = waiting({{{.name = "lo", .period = 40, .wcet = 2}, {on(0, 1, 2)}},
                                     {{.name = "hi", .period = 20, .wcet = 2}, {on(0, 1, 2)}}},
                                    2);
  EXPECT_EQ(run(workload, 20), "hi#0 w0 0-1 ~ w0 3-4\nlo#0 w1 0-1 ~ w1 5-6\n");
}

// The group is held across the wait. The job at the device inherits from the one that waits for the group, and passes
// `mid` in the device's queue.
TEST(Devices, AJobThatHoldsAGroupInheritsInTheQueue) {
  const Workload workload =
      waiting({{{.name = "hi", .period = 20, .wcet = 1, .group = "g", .offset = 4}},
               {{.name = "mid", .period = 30, .wcet = 2, .offset = 2}, {on(0, 1, 3)}},
               {{.name = "lo", .period = 40, .wcet = 2, .group = "g", .offset = 1}, {on(0, 1, 2)}},
               {{.name = "first", .period = 50, .wcet = 2}, {on(0, 1, 5)}}},
              2);
  EXPECT_EQ(run(workload, 20),
            "first#0 w0 0-1 ~ w0 6-7\n"
            "lo#0 w0 1-2 ~ w0 8-9\n"
            "mid#0 w0 2-3 ~ w0 11-12\n"
            "hi#0 w0 9-10\n");
}

TEST(WaitingJobs, CountForMaxActive) {
  Workload workload = make_workload(
      {make_dag("d", {{.name = "a", .period = 20, .wcet = 2}, {.name = "b", .period = 20, .wcet = 2}}, 1)}, 2);
  workload.dags[0].tasks[0].waits = {elsewhere(1, 5)};
  EXPECT_EQ(run(workload, 20), "a#0 w0 0-1 ~ w0 6-7\nb#0 w0 7-9\n");
}

// Cooperative: the job below continues while the one on top waits, and can be interrupted by it at its next point.
TEST(WaitingJobs, LeaveTheirWorkerToTheJobBelow) {
  Workload workload = waiting({{{.name = "hi", .period = 30, .wcet = 2, .offset = 1}, {elsewhere(1, 3)}},
                               {{.name = "lo", .period = 40, .wcet = 8}}},
                              1, PreemptionMode::Cooperative);
  workload.dags[1].tasks[0].region = 2 * kMs;
  EXPECT_EQ(run(workload, 20), "lo#0 w0 0-2 w0 3-7 w0 8-10\nhi#0 w0 2-3 ~ w0 7-8\n");
}

TEST(WaitingJobs, TheirBudgetIsProcessorTime) {
  Workload workload = waiting({{{.name = "a", .period = 20, .wcet = 4}, {elsewhere(1, 4)}}});
  workload.dags[0].tasks[0].budget = 2 * kMs;
  EXPECT_EQ(run(workload, 20), "a#0 w0 0-1 ~ w0 5-6\na#0 aborted budget 6\n");
}

// A wait that begins where the budget ends does not begin.
TEST(WaitingJobs, AreCutOffBeforeAWaitAtTheirBudget) {
  Workload workload = waiting({{{.name = "a", .period = 20, .wcet = 4}, {elsewhere(1, 4)}}});
  workload.dags[0].tasks[0].budget = kMs;
  EXPECT_EQ(run(workload, 20), "a#0 w0 0-1\na#0 aborted budget 1\n");
}

TEST(WaitingJobs, AResumptionTakesTheOverheadOfOne) {
  const Workload workload = waiting({{{.name = "a", .period = 20, .wcet = 3}, {elsewhere(1, 4)}}});
  Options options;
  options.overheads.dispatch = kMs;
  options.overheads.preempt = 2 * kMs;
  EXPECT_EQ(timeline(workload, simulate_events(workload, 20 * kMs, options)), "a#0 w0 0-2 ~ w0 6-10\n");
}

}  // namespace
}  // namespace redag::sim
