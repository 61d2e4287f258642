// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// A task of which two jobs can be in progress may end them in reverse order; the tests show what its successors get.
// They run on the scheduler and on the reference scheduler, because both could share a mistake.
#include <memory>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "redag/sched/priority_scheduler.hpp"
#include "tests/testing/builders.hpp"
#include "tests/testing/reference_scheduler.hpp"

namespace redag::testing {
namespace {

constexpr TaskId kSource(0);
constexpr TaskId kOther(1);
constexpr TaskId kSink(2);

// Times are in milliseconds. source#0 begins at 0 and source#1 at 10, which ends at 11. source#0 ends at 12; or it ends
// at 1 without output, and a job of the sink waits from 0 on.
class LateData : public ::testing::TestWithParam<bool> {
 public:
  void run(TestTask sink, Duration other_period, sched::Outcome first_outcome = sched::Outcome::Finished) {
    Workload workload = make_workload({make_dag("d", {{"source", 10}, {"other", other_period}, std::move(sink)})}, 3);
    workload.dags[0].tasks[0].concurrency = 2;
    const sched::Config config{3, sched::Preemption::None, workload.policy};
    if (GetParam()) {
      scheduler = std::make_unique<sched::PriorityScheduler>(workload, config);
    } else {
      scheduler = std::make_unique<ReferenceScheduler>(workload, config);
    }
    const JobSlot first = release(kSource, 0, 0);
    if (first_outcome != sched::Outcome::Finished) {
      release(kSink, 0, 0);
      scheduler->complete(first, kMillisecond, first_outcome);
    }
    const JobSlot second = release(kSource, 10, 10);
    end(second, 11);
    if (first_outcome == sched::Outcome::Finished) end(first, 12);
  }

  JobSlot release(TaskId task, Time nominal, Time now) {
    scheduler->release(task, nominal * kMillisecond, now * kMillisecond);
    return decide(now);
  }
  JobSlot end(JobSlot job, Time now) {
    scheduler->complete(job, now * kMillisecond, sched::Outcome::Finished);
    return decide(now);
  }

  /// The events of the sink as time, kind and value: "12 released 12, 12 ready 10".
  std::string told;
  std::unique_ptr<sched::Scheduler> scheduler;

 private:
  // Returns the job that was started last.
  JobSlot decide(Time now) {
    const sched::Step step = scheduler->dispatch(now * kMillisecond);
    for (const JobEvent &event : step.events) {
      if (event.task != kSink) continue;
      if (event.kind != JobEventKind::Released && event.kind != JobEventKind::Ready) continue;
      if (!told.empty()) told += ", ";
      told += std::to_string(event.time / kMillisecond) +
              (event.kind == JobEventKind::Ready ? " ready " : " released ") +
              std::to_string(event.value / kMillisecond);
    }
    return step.dispatches.empty() ? JobSlot() : step.dispatches.back().job;
  }
};

TEST_P(LateData, DoesNotReplaceNewerDataOfTheSamePeriod) {
  run({"sink", 10, 1, {0, 1}}, 10);
  release(kSink, 10, 13);  // its timer is late
  end(release(kOther, 10, 13), 14);
  EXPECT_EQ(told, "13 released 10, 14 ready 10");
}

TEST_P(LateData, DoesNotReplaceNewerDataOfAnotherRate) {
  run({"sink", 20, 1, {0, 1}}, 30);
  end(release(kOther, 13, 13), 14);
  release(kSink, 15, 15);
  EXPECT_EQ(told, "15 released 15, 15 ready 10");
}

TEST_P(LateData, DoesNotReplaceNewerDataOfAJoin) {
  run({"sink", 0, 1, {0, 1}}, 20);
  end(release(kOther, 13, 13), 14);
  EXPECT_EQ(told, "14 released 14, 14 ready 10");
}

// source#0 had no output. sink#0 must not take the data of source#1, although it waits when source#1 ends.
TEST_P(LateData, OfTheNextPeriodIsKeptForTheNextJob) {
  run({"sink", 10, 1, {0}}, 10, sched::Outcome::Threw);
  EXPECT_EQ(told, "0 released 0");
  release(kSink, 10, 13);
  EXPECT_EQ(told, "0 released 0, 13 released 10, 13 ready 10");
}

// Every completion counts, and none is lost: the second job has no newer data than the first one.
TEST_P(LateData, ReleasesADataTaskAsAnyOther) {
  run({"sink", 0, 1, {0}}, 20);
  EXPECT_EQ(told, "11 released 11, 11 ready 10, 12 released 12, 12 ready 10");
}

std::string name_of(const ::testing::TestParamInfo<bool> &tested) { return tested.param ? "scheduler" : "reference"; }

INSTANTIATE_TEST_SUITE_P(Both, LateData, ::testing::Bool(), name_of);

}  // namespace
}  // namespace redag::testing
