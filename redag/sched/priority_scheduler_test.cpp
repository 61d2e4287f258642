// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/sched/priority_scheduler.hpp"

#include <algorithm>
#include <memory>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "redag/derived/rng.hpp"
#include "tests/testing/allocation_counter.hpp"
#include "tests/testing/builders.hpp"
#include "tests/testing/manual_workers.hpp"

namespace redag::sched {
namespace {

using redag::testing::make_dag;
using redag::testing::make_workload;
using redag::testing::ManualWorkers;

ManualWorkers drive(const Workload &workload, Preemption preemption, std::uint32_t levels = 0,
                    std::uint32_t max_started = 0) {
  Config config{workload.platform.workers, preemption, workload.policy, levels, max_started};
  config.ties = workload.ties;
  return {workload, std::make_unique<PriorityScheduler>(workload, config), config.workers};
}

std::size_t count(const ManualWorkers &workers, JobEventKind kind) {
  std::size_t found = 0;
  for (const JobEvent &event : workers.events()) found += event.kind == kind ? 1U : 0U;
  return found;
}

TEST(PriorityScheduler, ReleasesOfOneInstantAreDecidedTogether) {
  const Workload workload = make_workload({make_dag("a", {{"slow", 20}, {"fast", 10}})}, 1);
  ManualWorkers workers = drive(workload, Preemption::None);
  workers.release("slow").release("fast").decide();
  EXPECT_EQ(workers.running(), "fast");
}

TEST(PriorityScheduler, DispatchWithoutEventsDecidesNothing) {
  const Workload workload = make_workload({make_dag("a", {{"t", 10}})}, 1);
  PriorityScheduler scheduler(workload, {});
  scheduler.release(TaskId(0), 0, 0);
  EXPECT_EQ(scheduler.dispatch(0).dispatches.size(), 1U);
  const Step again = scheduler.dispatch(5);
  EXPECT_TRUE(again.dispatches.empty());
  EXPECT_TRUE(again.events.empty());
}

TEST(PriorityScheduler, PreemptsTheLeastUrgentAndResumesItOnAnyWorker) {
  const Workload workload = make_workload({make_dag("a", {{"low", 30}, {"mid", 20}, {"high", 10}})}, 2);
  ManualWorkers workers = drive(workload, Preemption::Full);
  workers.release("low").release("mid").decide();
  EXPECT_EQ(workers.running(), "mid low");
  workers.at(1).release("high").decide();
  EXPECT_EQ(workers.running(), "mid high");
  EXPECT_EQ(workers.suspended(), "low");
  workers.at(2).finish("mid").decide();
  EXPECT_EQ(workers.running(), "low high");
}

TEST(PriorityScheduler, ATiedLevelDoesNotPreempt) {
  Workload workload = make_workload({make_dag("a", {{"second", 10}, {"first", 10}, {"third", 30}})}, 1);
  for (const Ties ties : {Ties::Share, Ties::Fixed}) {
    for (const std::uint32_t levels : {0U, 2U}) {
      workload.ties = ties;
      ManualWorkers workers = drive(workload, Preemption::Full, levels);
      workers.release("first").decide();
      workers.at(1).release("second").decide();  // same period, but first in the order of tasks
      EXPECT_EQ(workers.running(), ties == Ties::Fixed && levels == 0 ? "second" : "first");
    }
  }
}

TEST(PriorityScheduler, OfEqualsTheEarlierReleaseGoesFirst) {
  Workload workload = make_workload({make_dag("a", {{"one", 10}, {"two", 10}, {"busy", 30}})}, 1);
  for (const Ties ties : {Ties::Share, Ties::Fixed}) {
    workload.ties = ties;
    ManualWorkers workers = drive(workload, Preemption::None);
    workers.release("busy").decide();
    workers.at(1).release("two").at(2).release("one").decide();
    workers.at(3).finish("busy").decide();
    EXPECT_EQ(workers.running(), ties == Ties::Share ? "two" : "one");
  }
}

// The turn is the nominal release even if the release is seen later. At one instant the order of tasks decides.
TEST(PriorityScheduler, ATurnIsTheNominalRelease) {
  const Workload workload = make_workload({make_dag("a", {{"one", 10}, {"two", 10}, {"three", 10}, {"busy", 30}})}, 1);
  ManualWorkers workers = drive(workload, Preemption::None);
  workers.release("busy").decide();
  workers.at(5).release("three").at(6).release("two", 5).release("one", 6).decide();
  workers.at(7).finish("busy").decide();
  EXPECT_EQ(workers.running(), "two");
  workers.at(8).finish("two").decide();
  EXPECT_EQ(workers.running(), "three");
}

// A chain that began before an equal also ends before it, and so does data that is older than the driver's release.
TEST(PriorityScheduler, TheTurnOfADataTaskIsTheOriginOfItsData) {
  const Workload workload =
      make_workload({make_dag("a", {{"first", 10}, {"second", 0, 1, {0}}, {"third", 0, 1, {1}}, {"other", 10}})}, 1);
  ManualWorkers workers = drive(workload, Preemption::None);
  workers.release("first").decide();
  workers.at(1).release("other").decide();
  workers.at(2).finish("first").decide();
  EXPECT_EQ(workers.running(), "second");
  workers.at(3).finish("second").decide();
  EXPECT_EQ(workers.running(), "third");
  workers.at(4).finish("third").decide();
  EXPECT_EQ(workers.running(), "other");

  sched::PriorityScheduler scheduler(make_workload({make_dag("a", {{"busy", 20}, {"one", 10}, {"two", 10}})}, 1),
                                     {.workers = 1, .preemption = Preemption::None});
  scheduler.release(TaskId(0), 0, 0);
  const JobSlot busy = scheduler.dispatch(0).dispatches.front().job;
  scheduler.release(TaskId(1), 3, 3);
  scheduler.release(TaskId(2), 4, 4, 2);
  scheduler.complete(busy, 5, sched::Outcome::Finished);
  const sched::Step step = scheduler.dispatch(5);
  ASSERT_EQ(step.dispatches.size(), 1U);
  EXPECT_EQ(step.dispatches.front().task, TaskId(2));
  EXPECT_EQ(step.dispatches.front().origin, 2);
}

// A job that replaces another keeps its turn. Otherwise, with `overrun: skip`, a busy equal would go first for ever.
TEST(PriorityScheduler, AJobThatTakesAPlaceHasItsTurn) {
  const Workload workload = make_workload({make_dag("a", {{"heavy", 20, 25}, {"light", 20}})}, 1);
  ManualWorkers workers = drive(workload, Preemption::None);
  workers.release("heavy").release("light").decide();
  workers.at(20).release("heavy").release("light").decide();
  EXPECT_EQ(count(workers, JobEventKind::Skipped), 1U) << "the second light takes the place of the first";
  workers.at(25).finish("heavy").decide();
  EXPECT_EQ(workers.running(), "light");
}

// A job that waits for its predecessor is replaced, too, and passes on its turn.
TEST(PriorityScheduler, ATurnIsKeptWhileAJobWaitsForData) {
  const Workload workload = make_workload({make_dag("a", {{"heavy", 20, 25}, {"p", 20}, {"q", 20, 1, {1}}})}, 1);
  ManualWorkers workers = drive(workload, Preemption::None);
  workers.release("heavy").release("p").release("q").decide();
  workers.at(20).release("heavy").release("p").release("q").decide();
  workers.at(25).finish("heavy").decide();
  EXPECT_EQ(workers.running(), "p");
  workers.at(26).finish("p").decide();
  EXPECT_EQ(workers.running(), "q") << "before the second heavy";
}

// SCHED_FIFO continues a thread that it preempted before it runs a new one of the same level.
TEST(PriorityScheduler, APreemptedJobGoesOnBeforeItsEquals) {
  const Workload workload =
      make_workload({make_dag("a", {{"top", 5}, {"high", 10}, {"one", 20}, {"two", 20}, {"other", 30}})}, 1);
  for (const std::uint32_t levels : {0U, 2U}) {  // with two levels, `other` shares the level of `one` and `two`
    for (const char *preempted : {"two", "other"}) {
      if (levels == 0 && preempted == std::string("other")) continue;
      ManualWorkers workers = drive(workload, Preemption::Full, levels);
      workers.at(5).release(preempted).decide();
      workers.at(6).release("high").decide();
      workers.at(7).release("one", 1).decide();
      EXPECT_EQ(workers.running(), "high");
      workers.at(8).finish("high").decide();
      EXPECT_EQ(workers.running(), preempted);
    }
  }
}

TEST(PriorityScheduler, AHolderInheritsThePriorityAndNotTheTurn) {
  const Workload workload =
      make_workload({make_dag("a", {{"waits", 10, 1, {}, "g"}, {"equal", 10}, {"holds", 30, 9, {}, "g"}})}, 1);
  ManualWorkers workers = drive(workload, Preemption::Full);
  workers.release("holds").decide();
  workers.at(2).release("waits").decide();
  workers.at(3).release("equal", 1).decide();
  EXPECT_EQ(workers.running(), "holds") << "of one level now: no job preempts it";
  workers.at(9).finish("holds").decide();
  EXPECT_EQ(workers.running(), "equal");
}

TEST(PriorityScheduler, EqualDeadlinesTakeTurns) {
  Workload workload = make_workload({make_dag("a", {{"one", 10}, {"two", 10}, {"three", 15}})}, 1, PreemptionMode::None,
                                    PolicyKind::Edf);
  for (const Ties ties : {Ties::Share, Ties::Fixed}) {
    workload.ties = ties;
    ManualWorkers workers = drive(workload, Preemption::Full);
    workers.release("three").decide();
    workers.at(5 * kMillisecond).release("two").decide();  // both have their deadline at 15 ms
    EXPECT_EQ(workers.running(), ties == Ties::Share ? "three" : "two");
  }
}

TEST(PriorityScheduler, MoreStartedJobsThanThreadsIsImpossible) {
  const Workload workload = make_workload({make_dag("a", {{"low", 30}, {"mid", 20}, {"high", 10}})}, 1);
  ManualWorkers workers = drive(workload, Preemption::Full, 0, 2);
  workers.release("low").decide();
  workers.at(1).release("mid").decide();
  workers.at(2).release("high").decide();
  EXPECT_EQ(workers.running(), "mid") << "there is no third thread";
  workers.at(3).finish("mid").decide();
  EXPECT_EQ(workers.running(), "high");
  EXPECT_EQ(workers.suspended(), "low");
}

TEST(PriorityScheduler, APreemptedJobGoesBackToItsWorkerIfThatIsFree) {
  const Workload workload = make_workload({make_dag("a", {{"low", 30}, {"mid", 20}, {"high", 10}})}, 2);
  ManualWorkers workers = drive(workload, Preemption::Full);
  workers.release("low").release("mid").decide();
  workers.at(1).release("high").decide();
  workers.at(2).finish("mid").finish("high").decide();
  EXPECT_EQ(workers.running(), "- low");
}

// The holder takes the waiting job's place in the total order, not only its deadline. `second` has the same deadline as
// the waiting job and comes before it. It therefore comes before the holder, too.
TEST(PriorityScheduler, InheritanceTakesTheWholePlaceInTheOrder) {
  const Workload workload = make_workload({make_dag("a", {{"holder", 40, 1, {}, "g"}, {"filler", 40}}),
                                           make_dag("b", {{"first", 20}, {"second", 20}, {"waiting", 20, 1, {}, "g"}})},
                                          2, PreemptionMode::None, PolicyKind::Edf);
  ManualWorkers workers = drive(workload, Preemption::Full);
  workers.release("holder").release("filler").decide();
  workers.at(1).release("first").release("second").release("waiting").decide();
  EXPECT_EQ(workers.running(), "second first");
}

TEST(PriorityScheduler, AJobMayEndWhileItCountsAsPreempted) {
  const Workload workload = make_workload({make_dag("a", {{"low", 30}, {"high", 10}})}, 1);
  ManualWorkers workers = drive(workload, Preemption::Full);
  workers.release("low").decide();
  workers.at(1).release("high").decide();
  workers.at(2).finish("low").decide();
  EXPECT_EQ(workers.running(), "high");
  EXPECT_EQ(workers.suspended(), "");
  workers.at(3).finish("high").decide();
  EXPECT_EQ(workers.running(), "-");
}

TEST(PriorityScheduler, CooperativeJobsNestInOrder) {
  const Workload workload = make_workload({make_dag("a", {{"low", 40}, {"mid", 30}, {"high", 20}, {"top", 10}})}, 1);
  ManualWorkers workers = drive(workload, Preemption::Cooperative);
  workers.release("low").decide();
  workers.at(1).release("mid").release("high").decide();
  EXPECT_EQ(workers.running(), "low") << "only a preemption point gives way";
  workers.at(2).preemption_point("low").decide();
  EXPECT_EQ(workers.running(), "high");
  workers.at(3).release("top").decide();
  workers.at(4).preemption_point("high").decide();
  EXPECT_EQ(workers.running(), "top");
  workers.at(5).finish("top").decide();
  EXPECT_EQ(workers.running(), "high");
  workers.at(6).finish("high").decide();
  EXPECT_EQ(workers.running(), "mid") << "more urgent than the suspended job";
  workers.at(7).finish("mid").decide();
  EXPECT_EQ(workers.running(), "low");
}

TEST(PriorityScheduler, APreemptionPointWithoutNeedChangesNothing) {
  const Workload workload = make_workload({make_dag("a", {{"low", 40}, {"high", 20}})}, 1);
  ManualWorkers workers = drive(workload, Preemption::Cooperative);
  workers.release("high").decide();
  workers.at(1).release("low").decide();
  const std::size_t before_point = workers.events().size();
  workers.at(2).preemption_point("high").decide();
  EXPECT_EQ(workers.running(), "high");
  EXPECT_EQ(workers.events().size(), before_point);
}

TEST(PriorityScheduler, JobKWaitsForJobKWherePeriodsAreEqual) {
  const Workload workload = make_workload({make_dag("a", {{"first", 10}, {"second", 10, 1, {0}}})}, 2);
  ManualWorkers workers = drive(workload, Preemption::None);
  workers.release("first").release("second").decide();
  EXPECT_EQ(workers.running(), "first -");
  workers.at(10 * kMillisecond).release("first").release("second").decide();  // job 0 of `first` still runs
  workers.at(11 * kMillisecond).finish("first").decide();
  EXPECT_EQ(workers.running(), "first -") << "data of job 0 is too old for job 1 of `second`";
  workers.at(12 * kMillisecond).finish("first").decide();
  EXPECT_EQ(workers.running(), "second -");
  EXPECT_EQ(workers.accounting("second").skipped, 1U);
}

TEST(PriorityScheduler, DataOfAJobThatNeverStartedIsFreshAgain) {
  const Workload workload =
      make_workload({make_dag("a", {{"source", 40}, {"sink", 20, 1, {0}}}), make_dag("b", {{"hog", 10}})}, 1);
  ManualWorkers workers = drive(workload, Preemption::None);
  workers.release("source").release("sink").decide();
  workers.at(1).release("hog").finish("source").decide();
  EXPECT_EQ(workers.running(), "hog");
  workers.at(20 * kMillisecond).release("sink").decide();  // the ready job of `sink` is skipped; its data is kept
  workers.at(21 * kMillisecond).finish("hog").decide();
  EXPECT_EQ(workers.running(), "sink");
  EXPECT_EQ(workers.accounting("sink").skipped, 1U);
}

// Threads stamp the end of a job before they report it.
TEST(PriorityScheduler, ADataJobIsReleasedWhenTheLastOfItsDataIsThere) {
  Workload workload = make_workload({make_dag("a", {{"p", 10}, {"q", 10}, {"both", 10}})}, 2);
  workload.dags[0].tasks[2].activation = Activation::Data;
  workload.dags[0].tasks[2].predecessors = {0, 1};
  PriorityScheduler scheduler(workload, {.workers = 2});
  scheduler.release(TaskId(0), 0, 0);
  scheduler.release(TaskId(1), 0, 0);
  std::vector<JobSlot> jobs;
  for (const Dispatch &dispatch : scheduler.dispatch(0).dispatches) jobs.push_back(dispatch.job);
  ASSERT_EQ(jobs.size(), 2U);
  scheduler.complete(jobs[0], 7, Outcome::Finished);
  (void)scheduler.dispatch(7);
  scheduler.complete(jobs[1], 5, Outcome::Finished);
  const Step step = scheduler.dispatch(8);
  ASSERT_EQ(step.dispatches.size(), 1U);
  EXPECT_EQ(step.dispatches[0].release, 7) << "the end of what completed last, whoever reported last";
}

TEST(PriorityScheduler, AnAbortedJobReleasesNoSuccessor) {
  const Workload workload = make_workload({make_dag("a", {{"source", 40}, {"sink", 0, 1, {0}}})}, 1);
  ManualWorkers workers = drive(workload, Preemption::None);
  workers.release("source").decide();
  workers.at(1).finish("source", Outcome::Threw).decide();
  EXPECT_EQ(workers.accounting("sink").released, 0U);
  EXPECT_EQ(workers.accounting("source").aborted, 1U);
}

TEST(PriorityScheduler, AJobWithoutDataIsAbortedAndNotLost) {
  const Workload workload = make_workload({make_dag("a", {{"t", 40}})}, 1);
  ManualWorkers workers = drive(workload, Preemption::None);
  workers.release("t").decide();
  workers.at(1).finish("t", Outcome::NoData).decide();
  EXPECT_EQ(workers.accounting("t").aborted, 1U);
  EXPECT_EQ(workers.accounting("t").no_data, 1U);
  EXPECT_EQ(workers.accounting("t").lost(), 0U);
  workers.at(40).release("t").decide();
  workers.at(41).finish("t", Outcome::Threw).decide();
  EXPECT_EQ(workers.accounting("t").lost(), 1U);
}

TEST(PriorityScheduler, PendingBoundRefusesReleases) {
  Workload workload = make_workload({make_dag("a", {{"x", 10}, {"y", 20}, {"z", 30}})}, 1);
  workload.dags[0].max_pending = 1;
  ManualWorkers workers = drive(workload, Preemption::None);
  workers.release("x").decide();
  workers.at(1).release("y").release("z").decide();
  EXPECT_EQ(workers.accounting("z").skipped, 1U);
  EXPECT_EQ(workers.events().back().reason, Reason::DagFull);
}

TEST(PriorityScheduler, ADeferralIsCountedOnceAJob) {
  const Workload workload = make_workload({make_dag("a", {{"x", 10}, {"y", 20}}, 1), make_dag("b", {{"z", 30}})}, 2);
  ManualWorkers workers = drive(workload, Preemption::None);
  workers.release("x").release("y").decide();
  workers.at(1).release("z").decide();
  EXPECT_EQ(workers.running(), "x z");
  workers.at(2).finish("z").decide();
  EXPECT_EQ(count(workers, JobEventKind::Deferred), 1U);
  EXPECT_EQ(workers.accounting("y").deferred, 1U);
}

// A job that waits for a group must not take a place of its DAG from another job.
TEST(PriorityScheduler, AJobThatWaitsHoldsNothing) {
  const Workload workload = make_workload(
      {make_dag("a", {{"x", 10, 1, {}, "g"}, {"y", 20}}, 1), make_dag("b", {{"holder", 30, 1, {}, "g"}})}, 2);
  ManualWorkers workers = drive(workload, Preemption::None);
  workers.release("holder").decide();
  workers.at(1).release("x").release("y").decide();
  EXPECT_EQ(workers.running(), "holder y");
  workers.at(2).finish("holder").decide();
  EXPECT_EQ(workers.running(), "- y") << "now x waits for its DAG";
  workers.at(3).finish("y").decide();
  EXPECT_EQ(workers.running(), "x -");
}

TEST(PriorityScheduler, DagsComeAndGo) {
  const Workload workload = make_workload({make_dag("a", {{"x", 20}, {"y", 30}}, 1)}, 1);
  ManualWorkers workers = drive(workload, Preemption::Full);
  workers.release("x").release("y").decide();
  const DagId added = workers.at(1).add_dag(make_dag("b", {{"urgent", 10}, {"data", 0, 1, {0}}}));
  workers.release("urgent").decide();
  EXPECT_EQ(workers.running(), "urgent");
  workers.at(2).finish("urgent").decide();
  EXPECT_EQ(workers.running(), "data");
  workers.scheduler().remove_dag(added, 3);
  workers.at(3).release("urgent").decide();
  EXPECT_EQ(workers.running(), "data") << "what has started ends as usual";
  EXPECT_EQ(workers.accounting("urgent").released, 1U);
  workers.at(4).finish("data").decide();
  EXPECT_EQ(workers.running(), "x");
  workers.at(5).finish("x").decide();
  EXPECT_EQ(workers.running(), "y");
}

TEST(PriorityScheduler, RemovalSkipsWhatHasNotStarted) {
  const Workload workload = make_workload({make_dag("a", {{"x", 20}}), make_dag("b", {{"y", 30}})}, 1);
  ManualWorkers workers = drive(workload, Preemption::None);
  workers.release("x").release("y").decide();
  workers.scheduler().remove_dag(DagId(1), 1);
  workers.at(1).finish("x").decide();
  EXPECT_EQ(workers.running(), "-");
  EXPECT_EQ(workers.accounting("y"), (Accounting{1, 0, 1, 0, 0}));
}

TEST(PriorityScheduler, EdfAndFifoOrderJobs) {
  Workload workload = make_workload({make_dag("a", {{"late", 10}, {"soon", 50, 1, {}, "", 0, 5}, {"long", 100}})}, 1);
  for (const PolicyKind policy : {PolicyKind::Edf, PolicyKind::Fifo}) {
    workload.policy = policy;
    ManualWorkers workers = drive(workload, Preemption::Full);
    workers.release("long").decide();
    workers.at(1).release("late").decide();
    workers.at(2).release("soon").decide();
    EXPECT_EQ(workers.running(), policy == PolicyKind::Edf ? "soon" : "long");
    workers.at(3).finish(policy == PolicyKind::Edf ? "soon" : "long").decide();
    EXPECT_EQ(workers.running(), "late");
  }
}

// The scheduler allocates nothing after construction. The test has thousands of random events with bounds, groups,
// queues and preemption.
TEST(PriorityScheduler, AllocatesNothingInSteadyState) {
  for (const Preemption preemption : {Preemption::None, Preemption::Cooperative, Preemption::Full}) {
    for (const PolicyKind policy : {PolicyKind::RateMonotonic, PolicyKind::Edf, PolicyKind::Fifo}) {
      std::vector<Dag> dags;
      for (int d = 0; d < 10; ++d) {
        dags.push_back(make_dag("d", {{"a", 5 + d, 1, {}, "g"}, {"b", 50, 1, {0}}, {"c", 0, 1, {0, 1}}, {"e", 7}},
                                1U + static_cast<std::uint32_t>(d) % 3));
        dags.back().tasks[3].overrun = Overrun::Queue;
        dags.back().tasks[3].queue_depth = 3;
        dags.back().max_pending = 3;
      }
      const Workload workload = make_workload(dags, 4, PreemptionMode::None, policy);
      PriorityScheduler scheduler(workload, {4, preemption, policy, 0, 0});
      Rng rng(1);
      std::vector<JobSlot> running(4);
      const std::uint64_t before_run = redag::testing::allocation_count();
      for (Time now = 0; now < 20'000; ++now) {
        const auto dag = static_cast<std::uint32_t>(rng.uniform(0, 9));
        const auto task = static_cast<std::uint32_t>(rng.uniform(0, 2));
        scheduler.release(TaskId(4 * dag + (task == 2 ? 3 : task)), now, now);
        JobSlot &some = running[static_cast<std::size_t>(rng.uniform(0, 3))];
        if (some.valid() && rng.uniform01() < 0.5) {
          scheduler.complete(some, now, Outcome::Finished);
          some = JobSlot();
        } else if (some.valid() && preemption == Preemption::Cooperative) {
          scheduler.preemption_point(some, now);
        }
        for (const Dispatch &dispatch : scheduler.dispatch(now).dispatches) {
          if (dispatch.kind != DispatchKind::Level) running[dispatch.worker.value] = dispatch.job;
        }
      }
      EXPECT_EQ(redag::testing::allocation_count(), before_run);
    }
  }
}

// A timer that wakes late reports all releases of a task that it missed at one instant.
TEST(PriorityScheduler, ManyReleasesOfATaskAtOnceAllocateNothing) {
  PriorityScheduler scheduler(make_workload({make_dag("d", {{"a", 1}})}, 1), {1, Preemption::None});
  for (Time now = 0; now < 3; ++now) {
    const std::uint64_t before = redag::testing::allocation_count();
    for (std::size_t i = 0; i < kMostReleasesAtOnce; ++i) scheduler.release(TaskId(0), now, now);
    EXPECT_GE(scheduler.dispatch(now).events.size(), 2 * kMostReleasesAtOnce);
    EXPECT_EQ(redag::testing::allocation_count(), before);
  }
}

// One worker and one thread: the urgent job could have the worker, and waits for the thread.
TEST(PriorityScheduler, CountsJobsThatWaitForAThread) {
  Config config{1, Preemption::Full};
  config.max_started = 1;
  PriorityScheduler scheduler(make_workload({make_dag("d", {{"hi", 10}}), make_dag("e", {{"lo", 20}})}, 1), config);
  scheduler.release(TaskId(1), 0, 0);
  const JobSlot low = scheduler.dispatch(0).dispatches[0].job;
  EXPECT_EQ(scheduler.thread_waits(), 0U);
  scheduler.release(TaskId(0), 1, 1);
  EXPECT_TRUE(scheduler.dispatch(1).dispatches.empty());
  EXPECT_EQ(scheduler.thread_waits(), 1U);
  scheduler.complete(low, 2, Outcome::Finished);
  scheduler.dispatch(2);
  scheduler.release(TaskId(1), 3, 3);  // less urgent: it waits for the worker, not for the thread
  scheduler.dispatch(3);
  EXPECT_EQ(scheduler.thread_waits(), 1U);
}

Task lone_task(Duration period) { return testing::tick_task({.period = period, .deadline = period}); }

// Tasks and DAGs with edges and groups come and go while jobs run. Memory grows only to what exists at one time.
TEST(PriorityScheduler, ReusedIdsKeepMemoryFlat) {
  Rng rng(7);
  Config config{2, Preemption::Full, PolicyKind::RateMonotonic, 0, 0};
  config.reuse_ids = true;
  PriorityScheduler scheduler(Workload{}, config);
  const DagId home = scheduler.add_dag(Dag{}, 0);
  std::vector<TaskId> lone;
  std::vector<DagId> dags;
  std::vector<JobSlot> running;
  std::size_t group_number = 0;
  for (Time now = 1; now <= 10'000; ++now) {
    if (rng.uniform01() < 0.5 || lone.size() == 8) {
      const auto which = static_cast<std::ptrdiff_t>(rng.uniform(0, 7));
      if (which < static_cast<std::ptrdiff_t>(lone.size())) {
        scheduler.remove_task(lone[static_cast<std::size_t>(which)], now);
        lone.erase(lone.begin() + which);
      }
    } else {
      Task task = lone_task(rng.uniform(1, 50));
      if (rng.uniform01() < 0.5) task.group = "group " + std::to_string(group_number++);
      const TaskId id = scheduler.add_task(home, 0, task, now);
      EXPECT_EQ(scheduler.accounting(id), Accounting{});
      EXPECT_EQ(std::count(lone.begin(), lone.end(), id), 0);
      lone.push_back(id);
    }
    if (dags.size() == 3) {
      scheduler.remove_dag(dags.front(), now);
      dags.erase(dags.begin());
    } else if (rng.uniform01() < 0.3) {
      dags.push_back(scheduler.add_dag(make_dag("d", {{"a", 5}, {"b", 0, 1, {0}}, {"c", 7, 1, {0, 1}}}), now));
      scheduler.release(scheduler.tasks_of(dags.back())[0], now, now);
    }
    for (const TaskId id : lone) scheduler.release(id, now, now);
    while (running.size() > 1 || (!running.empty() && rng.uniform01() < 0.6)) {
      scheduler.complete(running.back(), now, Outcome::Finished);
      running.pop_back();
    }
    for (const Dispatch &dispatch : scheduler.dispatch(now).dispatches) {
      if (dispatch.kind == DispatchKind::Start) running.push_back(dispatch.job);
    }
  }
  EXPECT_GT(group_number, 2'000U);
  EXPECT_LE(scheduler.task_slots(), 8U + 4 * 3 + 16);
  EXPECT_LE(scheduler.dag_slots(), 1U + 4 + 16);
  EXPECT_LE(scheduler.table().jobs.size(), 3 * scheduler.task_slots());
  EXPECT_LE(scheduler.table().group_slots(), 8U + 16);
}

TEST(PriorityScheduler, WithoutReuseAnIdNamesOneTaskForEver) {
  PriorityScheduler scheduler(Workload{}, {});
  const DagId dag = scheduler.add_dag(Dag{}, 0);
  for (std::uint32_t i = 0; i < 5; ++i) {
    const TaskId id = scheduler.add_task(dag, 0, lone_task(10), 0);
    EXPECT_EQ(id, TaskId(i));
    scheduler.release(id, 0, 0);
    scheduler.remove_task(id, 0);
    scheduler.release(id, 1, 1);  // ignored
    EXPECT_EQ(scheduler.accounting(id), (Accounting{1, 0, 1, 0, 0}));
  }
}

// The operating system also schedules suspended jobs. A driver that is not told of their levels inverts priorities.
TEST(PriorityScheduler, TheLevelOfASuspendedJobIsTold) {
  const Workload workload = make_workload({make_dag("a", {{"slow", 100}, {"fast", 50}})}, 1);
  PriorityScheduler scheduler(workload, {1, Preemption::Full, PolicyKind::RateMonotonic, 0, 0});
  scheduler.release(TaskId(0), 0, 0);
  const JobSlot slow = scheduler.dispatch(0).dispatches[0].job;
  scheduler.release(TaskId(1), 1, 1);
  EXPECT_EQ(scheduler.dispatch(1).dispatches[0].over, slow);
  scheduler.add_dag(make_dag("b", {{"x", 1}, {"y", 2}}), 2);
  scheduler.set_timing(TaskId(1), 40 * kMillisecond, 40 * kMillisecond, 2);  // two changes of one step count once
  const Step step = scheduler.dispatch(2);
  ASSERT_EQ(step.dispatches.size(), 2U);
  EXPECT_TRUE(step.events.empty());
  for (const Dispatch &dispatch : step.dispatches) {
    EXPECT_EQ(dispatch.kind, DispatchKind::Level);
    EXPECT_EQ(dispatch.level, dispatch.job == slow ? 3U : 2U);
  }
}

TEST(PriorityScheduler, ALimitHoldsBackWhatHasNotStarted) {
  const Workload workload = make_workload({make_dag("a", {{"low", 30}, {"mid", 20}, {"high", 10}})}, 2);
  PriorityScheduler scheduler(workload, {2, Preemption::Full, PolicyKind::RateMonotonic, 0, 0});
  for (const std::size_t t : {0U, 1U, 2U}) scheduler.release(TaskId(t), 0, 0);
  EXPECT_TRUE(scheduler.dispatch(0, 0).dispatches.empty());
  const Step one = scheduler.dispatch(0, 1);
  ASSERT_EQ(one.dispatches.size(), 1U);
  EXPECT_EQ(one.dispatches[0].task, TaskId(2));
  const Step rest = scheduler.dispatch(0);
  ASSERT_EQ(rest.dispatches.size(), 1U);
  EXPECT_EQ(rest.dispatches[0].task, TaskId(1));
}

TEST(PriorityScheduler, ALimitLooksPastReadyJobsForSuspendedOnes) {
  const Workload workload = make_workload({make_dag("a", {{"low", 30}, {"mid", 20}, {"high", 10}})}, 1);
  PriorityScheduler scheduler(workload, {1, Preemption::Full, PolicyKind::RateMonotonic, 0, 0});
  scheduler.release(TaskId(0), 0, 0);
  const JobSlot low = scheduler.dispatch(0).dispatches[0].job;
  scheduler.release(TaskId(2), 1, 1);
  const JobSlot high = scheduler.dispatch(1).dispatches[0].job;
  scheduler.release(TaskId(1), 2, 2);
  scheduler.complete(high, 3, Outcome::Finished);
  const Step held = scheduler.dispatch(3, 0);
  ASSERT_EQ(held.dispatches.size(), 1U);
  EXPECT_EQ(held.dispatches[0].kind, DispatchKind::Resume);
  EXPECT_EQ(held.dispatches[0].job, low);
  const Step rest = scheduler.dispatch(3);
  ASSERT_EQ(rest.dispatches.size(), 1U);
  EXPECT_EQ(rest.dispatches[0].task, TaskId(1));
  EXPECT_EQ(rest.dispatches[0].over, low);
}

// The job that ended was the least urgent running one. A later job between the two must not be measured against it.
TEST(PriorityScheduler, AJobThatTakesAPlaceIsItsOwnVictim) {
  const Workload workload = make_workload(
      {make_dag("chain", {{.name = "a", .period = 10, .priority = 2}, {.name = "b", .after = {0}, .priority = 4}}),
       make_dag("others", {{.name = "c", .period = 10, .priority = 1}, {.name = "d", .period = 10, .priority = 3}})},
      1, PreemptionMode::Os, PolicyKind::Fixed);
  PriorityScheduler scheduler(workload, config_of(workload));
  scheduler.release(TaskId(0), 0, 0);
  const JobSlot a = scheduler.dispatch(0).dispatches.front().job;
  scheduler.release(TaskId(2), 1, 1);
  EXPECT_TRUE(scheduler.dispatch(1).dispatches.empty()) << "c does not preempt a";
  const Step step = scheduler.finish(a, 2, Outcome::Finished);
  ASSERT_EQ(step.dispatches.size(), 1U);
  EXPECT_EQ(step.dispatches.front().task, TaskId(1)) << "b takes the place of a";
  scheduler.release(TaskId(3), 3, 3);
  EXPECT_TRUE(scheduler.dispatch(3).dispatches.empty()) << "d preempts a, and not b";
}

TEST(PriorityScheduler, WhatIsRemovedTakesNoPlace) {
  const Workload workload = make_workload({make_dag("chain", {{"a", 10}, {"b", 0, 1, {0}}})}, 1);
  for (const std::string removed : {"nothing", "a", "b", "chain"}) {
    PriorityScheduler scheduler(workload, {});
    scheduler.release(TaskId(0), 0, 0);
    const JobSlot a = scheduler.dispatch(0).dispatches.front().job;
    if (removed == "chain") scheduler.remove_dag(DagId(0), 1);
    if (removed == "a" || removed == "b") scheduler.remove_task(TaskId(removed == "a" ? 0 : 1), 1);
    EXPECT_TRUE(scheduler.dispatch(1).dispatches.empty());
    EXPECT_EQ(scheduler.finish(a, 2, Outcome::Finished).dispatches.empty(), removed != "nothing") << removed;
  }
}

TEST(PriorityScheduler, RecordsOnlyTheKindsAskedFor) {
  const Workload workload = make_workload({make_dag("a", {{"t", 10}})}, 1);
  PriorityScheduler scheduler(workload, {});
  scheduler.record_only({JobEventKind::Ready, JobEventKind::Skipped});
  scheduler.release(TaskId(0), 0, 0);
  scheduler.release(TaskId(0), 10, 10);
  const Step step = scheduler.dispatch(10);
  std::vector<JobEventKind> kinds;
  for (const JobEvent &event : step.events) kinds.push_back(event.kind);
  EXPECT_EQ(kinds, (std::vector{JobEventKind::Ready, JobEventKind::Skipped, JobEventKind::Ready}));
  ASSERT_EQ(step.dispatches.size(), 1U);
  EXPECT_EQ(step.dispatches[0].number, 1U);
  EXPECT_EQ(scheduler.accounting(TaskId(0)).released, 2U);
}

}  // namespace
}  // namespace redag::sched
