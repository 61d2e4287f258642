// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// A task of which two jobs can be in progress may end them in the other order: what its successors then get. For the
// scheduler and for the reference scheduler alike, which would agree on a common mistake.
#include <memory>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "redag/sched/priority_scheduler.hpp"
#include "redag_testing/reference_scheduler.hpp"
#include "redag_testing/timeline.hpp"

namespace redag::testing {
namespace {

constexpr TaskId kSource(0);
constexpr TaskId kOther(1);
constexpr TaskId kSink(2);

// Times are milliseconds; source#0 begins at 0 and source#1 at 10; source#1 ends at 11 and source#0 at 12, or with no
// output at 1, while a job of the sink waits.
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

  /// What happened to the sink: "12 released 12, 12 ready 10": when, what, and the event's value.
  std::string told;
  std::unique_ptr<sched::Scheduler> scheduler;

 private:
  // The job that was started last.
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

// source#0 had no output: sink#0 is not what source#1 is for, although it waits when that ends.
TEST_P(LateData, OfTheNextPeriodIsKeptForTheNextJob) {
  run({"sink", 10, 1, {0}}, 10, sched::Outcome::Threw);
  EXPECT_EQ(told, "0 released 0");
  release(kSink, 10, 13);
  EXPECT_EQ(told, "0 released 0, 13 released 10, 13 ready 10");
}

// Every completion counts, and none is lost: the second job has nothing newer than what the first one had.
TEST_P(LateData, ReleasesADataTaskAsAnyOther) {
  run({"sink", 0, 1, {0}}, 20);
  EXPECT_EQ(told, "11 released 11, 11 ready 10, 12 released 12, 12 ready 10");
}

std::string name_of(const ::testing::TestParamInfo<bool> &tested) { return tested.param ? "scheduler" : "reference"; }

INSTANTIATE_TEST_SUITE_P(Both, LateData, ::testing::Bool(), name_of);

}  // namespace
}  // namespace redag::testing
