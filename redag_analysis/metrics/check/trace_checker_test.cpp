// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Every rule with at least one hand-written trace that keeps it and one that breaks it. check_dispatch_test.cpp has
// those of preemption, check_overload_test.cpp those of overload.
#include "redag_analysis/metrics/check/trace_checker.hpp"

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

// hi: T 10, C 1; lo: T 20, C 4. One worker.
Workload two_tasks(PreemptionMode preemption = PreemptionMode::None, std::uint32_t workers = 1) {
  return make_workload({make_dag("a", {{"hi", 10, 1}}), make_dag("b", {{"lo", 20, 4}})}, workers, preemption);
}

TraceBuilder two_tasks_run() {
  TraceBuilder t(two_tasks());
  t.at(0).arrives("hi", 0).arrives("lo", 0).dispatched("hi", 0, 0, 10);
  t.at(1).finished("hi", 0, 0).dispatched("lo", 0, 0, 20).at(5).finished("lo", 0, 0);
  return t;
}

TEST(CheckTrace, AcceptsAGoodRun) {
  const CheckReport report = check_trace(two_tasks_run().until(10));
  EXPECT_TRUE(report.ok()) << report.to_string();
  EXPECT_EQ(report.to_string(), "");
  for (const Rule rule : {Rule::Stream, Rule::Life, Rule::Conservation, Rule::Grid, Rule::Precedence, Rule::Deadline,
                          Rule::TaskOverlap, Rule::Worker, Rule::Priority, Rule::WorkConservation, Rule::Execution}) {
    EXPECT_GT(report.checks(rule), 0U) << to_string(rule);
  }
}

// The program releases the task of the second cluster.
TEST(CheckTrace, TasksWithoutAGridAreThoseOfTheirCluster) {
  Workload workload = two_tasks();
  workload.platform.workers = 2;
  workload.platform.clusters = {{.name = "one", .workers = 1}, {.name = "two", .workers = 1}};
  workload.dags[0].cluster = "one";
  workload.dags[1].cluster = "two";
  TraceBuilder t(workload);
  t.at(0).arrives("hi", 0).dispatched("hi", 0, 0, 10).at(1).finished("hi", 0, 0);
  t.at(3).arrives("lo", 0).dispatched("lo", 0, 1, 23).at(7).finished("lo", 0, 1);
  trace::Trace trace = t.until(10);
  expect_broken(trace, Rule::Grid);
  trace.info.event_tasks = {TaskId(1)};
  expect_kept(trace, Rule::Grid);
}

// The less urgent job goes first. Until its rate was learned, it was the more urgent one.
TEST(CheckTrace, OrderIsJudgedByTheRatesThatHeld) {
  TraceBuilder t(two_tasks());
  t.at(0).arrives("hi", 0).arrives("lo", 0).dispatched("lo", 0, 0, 20);
  t.at(4).finished("lo", 0, 0).dispatched("hi", 0, 0, 10).at(5).finished("hi", 0, 0);
  trace::Trace trace = t.until(10);
  expect_broken(trace, Rule::Priority);
  trace.info.settled = 0;
  const CheckReport report = check_trace(trace);
  EXPECT_TRUE(report.ok()) << report.to_string();
  EXPECT_GT(report.not_judged, 0U);
  EXPECT_GT(report.checks(Rule::Worker), 0U);
  trace.info.settled = -1;
  expect_broken(trace, Rule::Priority);
}

TEST(CheckTrace, AJobKeepsTheDeadlineOfItsRelease) {
  TraceBuilder t(two_tasks());
  t.at(0).arrives("hi", 0).arrives("lo", 0).dispatched("hi", 0, 0, 10);
  t.at(1).finished("hi", 0, 0).dispatched("lo", 0, 0, 19).at(5).finished("lo", 0, 0);
  trace::Trace trace = t.until(10);
  expect_broken(trace, Rule::Deadline);
  trace.info.settled = 0;
  expect_kept(trace, Rule::Deadline);
}

TEST(CheckTrace, NamesTheJobTheTimeAndTheRule) {
  trace::Trace trace = two_tasks_run().until(10);
  trace.events[5].value -= kMillisecond;  // finish of hi#0, as measured
  const CheckReport report = check_trace(trace);
  ASSERT_FALSE(report.ok());
  EXPECT_EQ(report.violations.front().to_string(), "1ms a.hi#0: execution: it executed for 0s; expected 1ms (event 5)");
}

TEST(CheckTrace, StreamTimesNeverDecrease) {
  trace::Trace trace = two_tasks_run().until(10);
  trace.events.back().time = 0;
  expect_broken(trace, Rule::Stream);
}

TEST(CheckTrace, StreamWithLostEventsIsNotChecked) {
  trace::Trace trace = two_tasks_run().until(10);
  trace.info.lost_events = 3;
  const CheckReport report = check_trace(trace);
  EXPECT_EQ(report.violation_count, 1U);
  EXPECT_EQ(report.violated(Rule::Stream), 1U);
}

TEST(CheckTrace, StreamKnowsItsTasks) {
  trace::Trace trace = two_tasks_run().until(10);
  trace.events.back().task = TaskId(7);
  expect_broken(trace, Rule::Stream);
}

TEST(CheckTrace, StartedMayComeLateFromAnotherRing) {
  TraceBuilder t(two_tasks());
  t.at(0).arrives("hi", 0).arrives("lo", 0).dispatched("hi", 0, 0, 10).started("hi", 0, 0);
  t.at(1).finished("hi", 0, 0).dispatched("lo", 0, 0, 20).at(2).started("lo", 0, 0);
  expect_kept(t.until(3), Rule::Life);
  expect_broken(t.at(2).started("lo", 0, 0).until(3), Rule::Life);
}

TEST(CheckTrace, LifeOfEachJob) {
  const trace::Trace good = two_tasks_run().until(10);
  for (std::size_t i = 0; i < good.events.size(); ++i) {
    trace::Trace doubled = good;
    doubled.events.insert(doubled.events.begin() + static_cast<std::ptrdiff_t>(i), good.events[i]);
    expect_broken(doubled, good.events[i].kind == JobEventKind::Dispatched ? Rule::Worker : Rule::Life);
    trace::Trace renumbered = good;
    ++renumbered.events[i].job;
    EXPECT_FALSE(check_trace(renumbered).ok()) << i;
    trace::Trace missing = good;
    missing.events.erase(missing.events.begin() + static_cast<std::ptrdiff_t>(i));
    EXPECT_FALSE(check_trace(missing).ok()) << i;
  }
}

TEST(CheckTrace, ConservationCountsReleasesTwice) {
  trace::Trace trace = two_tasks_run().until(10);
  trace.events.push_back(trace.events.front());  // hi#0 again: released twice, ended once
  expect_broken(trace, Rule::Life);
  trace.events.insert(trace.events.begin(), trace.events.front());
  expect_broken(trace, Rule::Conservation);
}

TEST(CheckTrace, GridOfTimers) {
  TraceBuilder off_grid(two_tasks());
  off_grid.at(2).released("hi", 0);
  expect_broken(off_grid.until(3), Rule::Grid);

  TraceBuilder late(two_tasks());  // for the right time, but later than its jitter allows
  late.at(2).released_for("hi", 0, 0).ready("hi", 0, 0).dispatched("hi", 0, 0, 10);
  expect_broken(late.until(3), Rule::Grid);
  trace::Trace real = late.until(3);
  real.info.driver = trace::Driver::Threads;  // a real timer may be late
  EXPECT_EQ(check_trace(real).violated(Rule::Grid), 0U);

  expect_broken(two_tasks_run().until(12), Rule::Grid);  // hi#1 of 10 ms is missing
}

TEST(RulesFor, DependOnWhoSawTheRun) {
  const auto broken = [](trace::Trace trace, Rule rule, trace::Driver driver, const char *executor) {
    trace.info.driver = driver;
    trace.info.executor = executor;
    const CheckReport report = check_trace(trace, rules_for(trace.info));
    EXPECT_EQ(report.violation_count, report.violated(rule)) << report.to_string();
    return !report.ok();
  };
  TraceBuilder less_urgent(two_tasks());
  less_urgent.at(0).arrives("hi", 0).arrives("lo", 0).dispatched("lo", 0, 0, 20);
  less_urgent.at(4).finished("lo", 0, 0).dispatched("hi", 0, 0, 10).at(5).finished("hi", 0, 0);
  const trace::Trace order = less_urgent.until(10);
  EXPECT_TRUE(broken(order, Rule::Priority, trace::Driver::Simulator, "redag"));
  EXPECT_TRUE(broken(order, Rule::Priority, trace::Driver::Threads, "redag"));
  EXPECT_TRUE(broken(order, Rule::Priority, trace::Driver::Ros, "redag"));
  EXPECT_FALSE(broken(order, Rule::Priority, trace::Driver::RosNodes, "redag"));
  EXPECT_FALSE(broken(order, Rule::Priority, trace::Driver::Threads, "mte"));

  TraceBuilder own_grid(two_tasks());  // the timer's first expiry is not at time 0 + offset
  own_grid.at(3).released_for("hi", 0, 3).ready("hi", 0, 3).dispatched("hi", 0, 0, 13).at(4).finished("hi", 0, 0);
  const trace::Trace grid = own_grid.until(10);
  EXPECT_TRUE(broken(grid, Rule::Grid, trace::Driver::Threads, "redag"));
  EXPECT_FALSE(broken(grid, Rule::Grid, trace::Driver::Ros, "redag"));
  EXPECT_TRUE(broken(grid, Rule::Grid, trace::Driver::RosNodes, "ste"));
}

// hi, then lo, twice each. The second job of lo becomes ready before the second one of hi ends.
trace::Trace run_of_callbacks() {
  TraceBuilder t(two_tasks(PreemptionMode::None, 2));
  t.at(0).arrives("hi", 0).dispatched("hi", 0, 0, 10).at(1).finished("hi", 0, 0);
  t.at(1).arrives("lo", 0).dispatched("lo", 0, 0, 21).at(5).finished("lo", 0, 0);
  t.at(10).arrives("hi", 1).dispatched("hi", 1, 0, 20);
  t.at(11).arrives("lo", 1).dispatched("lo", 1, 1, 31).at(12).finished("hi", 1, 0).at(15).finished("lo", 1, 1);
  trace::Trace trace = t.until(20);
  trace.info.driver = trace::Driver::Ros;
  return trace;
}

TEST(CheckTrace, EdgesOfCallbacksHoldForTheirTime) {
  const auto broken = [](trace::Trace trace, const trace::Edge &edge) {
    trace.info.edges = {edge};
    const CheckReport report = check_trace(trace, rules_for(trace.info));
    EXPECT_EQ(report.violation_count, report.violated(Rule::Precedence)) << report.to_string();
    return report.violation_count;
  };
  const trace::Trace trace = run_of_callbacks();
  const TaskId hi(0);
  const TaskId lo(1);
  EXPECT_EQ(broken(trace, {.from = hi, .to = lo}), 1U);
  EXPECT_EQ(broken(trace, {.from = hi, .to = lo, .since = 12 * kMillisecond}), 0U) << "it came later";
  EXPECT_EQ(broken(trace, {.from = hi, .to = lo, .until = 11 * kMillisecond}), 0U) << "it had gone";
  EXPECT_EQ(broken(trace, {.from = lo, .to = hi}), 1U) << "the first job of hi";
}

// src (T 10, C 1) -> aligned (T 10, same grid), slower (T 20) and data.
Workload diamond() {
  return make_workload(
      {make_dag("d", {{"src", 10, 1}, {"aligned", 10, 1, {0}}, {"slower", 20, 1, {0}}, {"data", 0, 1, {0}}})}, 1);
}

TraceBuilder diamond_start() {
  TraceBuilder t(diamond());
  t.at(0).arrives("src", 0).released("aligned", 0).released("slower", 0).dispatched("src", 0, 0, 10);
  t.at(1).finished("src", 0, 0);
  return t;
}

TEST(CheckTrace, PrecedenceResolvesWithFreshData) {
  TraceBuilder t = diamond_start();
  t.ready("aligned", 0, 0).ready("slower", 0, 0).released("data", 0).ready("data", 0, 0);
  t.dispatched("aligned", 0, 0, 10).at(2).finished("aligned", 0, 0).dispatched("data", 0, 0, 11);
  t.at(3).finished("data", 0, 0).dispatched("slower", 0, 0, 20).at(4).finished("slower", 0, 0);
  expect_kept(t.until(10), Rule::Precedence);

  // Next period: aligned#1 must wait for src#1.
  t.at(10).arrives("src", 1).released("aligned", 1);
  TraceBuilder stale = t;
  expect_broken(stale.ready("aligned", 1, 0).dispatched("src", 1, 0, 20).until(11), Rule::Precedence);
}

// src#0 ends after src#1: join#1 has the data of src#1, and waits for other#1.
TEST(CheckTrace, PrecedenceKeepsTheNewestData) {
  Workload w = make_workload({make_dag("d", {{"src", 10}, {"other", 10}, {"join", 10, 1, {0, 1}}})}, 3);
  w.dags[0].tasks[0].concurrency = 2;
  w.dags[0].tasks[2].jitter = 5 * kMillisecond;
  TraceBuilder t(w);
  t.at(0).arrives("src", 0).arrives("other", 0).released("join", 0);
  t.dispatched("src", 0, 0, 10).dispatched("other", 0, 1, 10);
  t.at(10).arrives("src", 1).arrives("other", 1).dispatched("src", 1, 2, 20);
  t.at(11).finished("src", 1, 2).at(12).finished("src", 0, 0);
  t.at(13).released_for("join", 1, 10).skipped("join", 0, Reason::Precedence);
  t.at(14).finished("other", 0, 1).dispatched("other", 1, 0, 20).at(16).finished("other", 1, 0);
  const auto check = [](const TraceBuilder &built) {
    const trace::Trace trace = built.until(17);
    return check_trace(trace, rules_for(trace.info).without(Rule::Execution));
  };
  EXPECT_GT(check(t).violated(Rule::Precedence), 0U) << "join#1 is not ready";
  TraceBuilder older = t;
  older.ready("join", 1, 0).dispatched("join", 1, 0, 20);
  EXPECT_GT(check(older).violated(Rule::Precedence), 0U);
  t.ready("join", 1, 10).dispatched("join", 1, 0, 20);
  EXPECT_TRUE(check(t).ok()) << check(t).to_string();
}

// src#0 throws: aligned#0 never gets its data, and must not take that of src#1.
TEST(CheckTrace, PrecedenceIsOfTheSamePeriod) {
  Workload w = make_workload({make_dag("d", {{"src", 10}, {"aligned", 10, 1, {0}}})}, 1);
  w.dags[0].tasks[1].jitter = 5 * kMillisecond;
  TraceBuilder t(w);
  t.at(0)
      .arrives("src", 0)
      .released("aligned", 0)
      .dispatched("src", 0, 0, 10)
      .at(1)
      .aborted("src", 0, 0, Reason::Exception);
  t.at(10).arrives("src", 1).dispatched("src", 1, 0, 20).at(11).finished("src", 1, 0);
  TraceBuilder other_period = t;
  other_period.ready("aligned", 0, 10).dispatched("aligned", 0, 0, 10);
  expect_broken(other_period.until(12), Rule::Precedence);
  t.at(13).released_for("aligned", 1, 10).skipped("aligned", 0, Reason::Precedence);
  t.ready("aligned", 1, 10).dispatched("aligned", 1, 0, 20).at(14).finished("aligned", 1, 0);
  expect_kept(t.until(15), Rule::Precedence);
}

TEST(CheckTrace, PrecedenceOwesReadiness) {
  TraceBuilder t = diamond_start();
  t.ready("aligned", 0, 0).released("data", 0).ready("data", 0, 0).dispatched("aligned", 0, 0, 10);
  expect_broken(t.until(2), Rule::Precedence);  // slower#0 has its data
}

TEST(CheckTrace, PrecedenceOwesADataRelease) {
  TraceBuilder t = diamond_start();
  t.ready("aligned", 0, 0).ready("slower", 0, 0).dispatched("aligned", 0, 0, 10);
  expect_broken(t.until(2), Rule::Precedence);
}

TEST(CheckTrace, PrecedenceChecksOriginAndReleaseOfDataJobs) {
  TraceBuilder wrong_release = diamond_start();
  wrong_release.ready("aligned", 0, 0).ready("slower", 0, 0).released_for("data", 0, 0).ready("data", 0, 0);
  expect_broken(wrong_release.dispatched("aligned", 0, 0, 10).until(2), Rule::Precedence);
  TraceBuilder wrong_origin = diamond_start();
  wrong_origin.ready("aligned", 0, 0).ready("slower", 0, 0).released("data", 0).ready("data", 0, 1);
  expect_broken(wrong_origin.dispatched("aligned", 0, 0, 10).until(2), Rule::Precedence);
}

TEST(CheckTrace, PrecedenceAbortedJobsReleaseNobody) {
  TraceBuilder t(diamond());
  t.at(0).arrives("src", 0).released("aligned", 0).released("slower", 0).dispatched("src", 0, 0, 10);
  t.at(1).aborted("src", 0, 0, Reason::Exception);
  expect_kept(t.until(5), Rule::Life);
  expect_broken(t.released("data", 0).ready("data", 0, 0).dispatched("data", 0, 0, 11).until(2), Rule::Precedence);
}

// blocker: T 100, C 25, more urgent by its DAG's policy. victim: T 10.
TraceBuilder overrun_run() {
  Workload w = make_workload({make_dag("a", {{"blocker", 100, 25}}), make_dag("b", {{"victim", 10, 1, {}, "", 1}})}, 1);
  TraceBuilder t(w);
  t.at(0).arrives("blocker", 0).dispatched("blocker", 0, 0, 100).at(1).arrives("victim", 0);
  t.at(11).released("victim", 1);
  return t;
}

TEST(CheckTrace, AdmissionSkipsTheOldJob) {
  TraceBuilder good = overrun_run();
  good.skipped("victim", 0, Reason::Overrun).ready("victim", 1, 11);
  expect_kept(good.until(15), Rule::Admission);

  TraceBuilder wrong_reason = overrun_run();
  expect_broken(wrong_reason.skipped("victim", 0, Reason::Precedence).ready("victim", 1, 11).until(15),
                Rule::Admission);
  TraceBuilder forgotten = overrun_run();
  expect_broken(forgotten.ready("victim", 1, 11).until(15), Rule::Admission);
  TraceBuilder wrong_job = overrun_run();
  expect_broken(wrong_job.skipped("victim", 1, Reason::Overrun).until(15), Rule::Admission);
  TraceBuilder groundless = two_tasks_run();
  groundless.at(10).arrives("hi", 1).skipped("hi", 1, Reason::Overrun);
  expect_broken(groundless.until(10), Rule::Admission);
}

TEST(CheckTrace, AdmissionSkipsWhatIsNotReady) {
  TraceBuilder t(make_workload({make_dag("a", {{"src", 40, 1, {}, "", 39}, {"sink", 10, 1, {0}}})}, 1));
  t.at(0).released("sink", 0).at(10).released("sink", 1);
  TraceBuilder good = t;
  expect_kept(good.skipped("sink", 0, Reason::Precedence).until(20), Rule::Admission);
  expect_broken(t.skipped("sink", 0, Reason::Overrun).until(20), Rule::Admission);
}

TEST(CheckTrace, AdmissionQueues) {
  Workload w = make_workload({make_dag("a", {{"blocker", 100, 45}}), make_dag("b", {{"q", 10, 1, {}, "", 1}})}, 1);
  w.dags[1].tasks[0].overrun = Overrun::Queue;
  w.dags[1].tasks[0].queue_depth = 2;
  TraceBuilder t(w);
  t.at(0).arrives("blocker", 0).dispatched("blocker", 0, 0, 100).at(1).arrives("q", 0).at(11).arrives("q", 1);
  t.at(21).released("q", 2);
  TraceBuilder good = t;
  expect_kept(good.skipped("q", 2, Reason::QueueFull).until(30), Rule::Admission);
  TraceBuilder too_many = t;
  expect_broken(too_many.ready("q", 2, 21).until(30), Rule::Admission);
  TraceBuilder early = t;  // fewer jobs wait than the queue holds
  early.skipped("q", 2, Reason::QueueFull).at(31).released("q", 3).skipped("q", 0, Reason::Overrun);
  expect_broken(early.until(40), Rule::Admission);
}

TEST(CheckTrace, AdmissionBoundsThePendingJobsOfADag) {
  Workload w = make_workload(
      {make_dag("a", {{"blocker", 100, 45}}), make_dag("b", {{"x", 50, 1, {}, "", 1}, {"y", 50, 1, {}, "", 2}})}, 1);
  w.dags[1].max_pending = 1;
  TraceBuilder t(w);
  t.at(0).arrives("blocker", 0).dispatched("blocker", 0, 0, 100).at(1).arrives("x", 0).at(2).released("y", 0);
  TraceBuilder good = t;
  expect_kept(good.skipped("y", 0, Reason::DagFull).until(10), Rule::Admission);
  expect_broken(t.ready("y", 0, 2).until(10), Rule::Admission);
}

TEST(CheckTrace, Deadline) {
  trace::Trace trace = two_tasks_run().until(10);
  trace.events[4].value += 1;
  expect_broken(trace, Rule::Deadline);
}

TEST(CheckTrace, TaskOverlapAndOrder) {
  Workload w = make_workload({make_dag("a", {{"t", 10, 15}})}, 2);
  w.dags[0].tasks[0].overrun = Overrun::Queue;
  w.dags[0].tasks[0].queue_depth = 5;
  TraceBuilder t(w);
  t.at(0).arrives("t", 0).dispatched("t", 0, 0, 10).at(10).arrives("t", 1);
  TraceBuilder good = t;
  expect_kept(good.at(15).finished("t", 0, 0).dispatched("t", 1, 0, 20).until(20), Rule::TaskOverlap);
  TraceBuilder overlap = t;
  expect_broken(overlap.dispatched("t", 1, 1, 20).until(12), Rule::TaskOverlap);
  TraceBuilder overtaken = t;
  overtaken.at(15).finished("t", 0, 0).dispatched("t", 1, 0, 20).at(20).arrives("t", 2).at(30).arrives("t", 3);
  overtaken.finished("t", 1, 0).dispatched("t", 3, 0, 40);
  expect_broken(overtaken.until(31), Rule::TaskOverlap);
}

// x and y of one DAG with max_active 1; z of another; two workers.
TraceBuilder bounded() {
  TraceBuilder t(make_workload({make_dag("a", {{"x", 10, 2}, {"y", 10, 2}}, 1), make_dag("b", {{"z", 20, 4}})}, 2));
  t.at(0).arrives("x", 0).arrives("y", 0).arrives("z", 0).dispatched("x", 0, 0, 10);
  return t;
}

TEST(CheckTrace, MaxActiveAndDeferral) {
  TraceBuilder good = bounded();
  good.deferred("y", 0).dispatched("z", 0, 1, 20).at(2).finished("x", 0, 0).dispatched("y", 0, 0, 10);
  expect_kept(good.until(3), Rule::MaxActive);
  expect_kept(good.until(3), Rule::Deferral);

  TraceBuilder over = bounded();
  expect_broken(over.dispatched("y", 0, 1, 10).until(1), Rule::MaxActive);

  TraceBuilder groundless(two_tasks());
  groundless.at(0).arrives("hi", 0).arrives("lo", 0).dispatched("hi", 0, 0, 10).deferred("lo", 0);
  expect_broken(groundless.until(1), Rule::Deferral);

  TraceBuilder uncounted(make_workload({make_dag("a", {{"x", 10, 2}, {"y", 10, 2}}, 1)}, 2));
  uncounted.at(0).arrives("x", 0).arrives("y", 0).dispatched("x", 0, 0, 10);
  expect_broken(uncounted.until(1), Rule::Deferral);
}

TEST(CheckTrace, MaxStartedIsABoundToo) {
  TraceBuilder t(make_workload({make_dag("a", {{"x", 10, 2}, {"y", 10, 2}})}, 2, PreemptionMode::Os));
  t.at(0).arrives("x", 0).arrives("y", 0).dispatched("x", 0, 0, 10);
  trace::Trace one = t.until(1);
  one.info.config.max_started = 1;
  expect_kept(one, Rule::MaxActive);
  trace::Trace two = t.dispatched("y", 0, 1, 10).until(1);
  two.info.config.max_started = 1;
  expect_broken(two, Rule::MaxActive);
}

TEST(CheckTrace, GroupsExclude) {
  const Workload w = make_workload({make_dag("a", {{"x", 10, 2, {}, "g"}}), make_dag("b", {{"y", 20, 2, {}, "g"}})}, 2);
  TraceBuilder t(w);
  t.at(0).arrives("x", 0).arrives("y", 0).dispatched("x", 0, 0, 10);
  TraceBuilder good = t;
  expect_kept(good.at(2).finished("x", 0, 0).dispatched("y", 0, 0, 20).until(3), Rule::Group);
  expect_broken(t.dispatched("y", 0, 1, 20).until(1), Rule::Group);
}

TEST(CheckTrace, WorkersRunOneJobAtATime) {
  TraceBuilder t(two_tasks());
  t.at(0).arrives("hi", 0).arrives("lo", 0).dispatched("hi", 0, 0, 10);
  TraceBuilder twice = t;
  expect_broken(twice.dispatched("lo", 0, 0, 20).until(1), Rule::Worker);
  TraceBuilder nowhere = t;
  expect_broken(nowhere.at(1).finished("hi", 0, 0).dispatched("lo", 0, 5, 20).until(2), Rule::Worker);
}

TEST(CheckTrace, PriorityOfTheChosen) {
  TraceBuilder t(two_tasks());
  t.at(0).arrives("hi", 0).arrives("lo", 0).dispatched("lo", 0, 0, 20);
  expect_broken(t.until(1), Rule::Priority);
  EXPECT_TRUE(check_trace(t.until(1), RuleSet::rclcpp()).ok());
}

TEST(CheckTrace, PriorityFollowsThePolicy) {
  // hi has the smaller period. lo has the earlier deadline and, at 2 ms, was ready first.
  Workload w = make_workload({make_dag("a", {{"hi", 10, 1, {}, "", 2}}), make_dag("b", {{"lo", 20, 1, {}, "", 1, 5}}),
                              make_dag("c", {{"first", 50, 3}})},
                             1);
  const auto run = [&](PolicyKind policy, const char *next, Time deadline) {
    w.policy = policy;
    TraceBuilder t(w);
    t.at(0).arrives("first", 0).dispatched("first", 0, 0, 50).at(1).arrives("lo", 0).at(2).arrives("hi", 0);
    t.at(3).finished("first", 0, 0).dispatched(next, 0, 0, deadline);
    return check_trace(t.until(4)).violated(Rule::Priority) == 0;
  };
  EXPECT_TRUE(run(PolicyKind::RateMonotonic, "hi", 12));
  EXPECT_FALSE(run(PolicyKind::RateMonotonic, "lo", 6));
  for (const PolicyKind policy : {PolicyKind::DeadlineMonotonic, PolicyKind::Edf, PolicyKind::Fifo}) {
    EXPECT_TRUE(run(policy, "lo", 6)) << to_string(policy);
    EXPECT_FALSE(run(policy, "hi", 12)) << to_string(policy);
  }
}

TEST(CheckTrace, WorkIsConserved) {
  TraceBuilder t(two_tasks());
  expect_broken(t.at(0).arrives("hi", 0).arrives("lo", 0).until(1), Rule::WorkConservation);
  EXPECT_TRUE(check_trace(t.until(1), RuleSet::rclcpp()).ok());
}

TEST(CheckTrace, ExecutionIsWhatTheJobNeeds) {
  TraceBuilder longer(two_tasks());
  longer.at(0).arrives("hi", 0).arrives("lo", 0).dispatched("hi", 0, 0, 10).at(2).finished("hi", 0, 0);
  longer.dispatched("lo", 0, 0, 20);
  expect_broken(longer.until(3), Rule::Execution);
  trace::Trace with_overheads = longer.until(3);
  with_overheads.info.overheads = "dispatch 1ms";
  expect_kept(with_overheads, Rule::Execution);

  TraceBuilder endless(two_tasks());
  endless.at(0).arrives("hi", 0).arrives("lo", 0).dispatched("hi", 0, 0, 10);
  expect_broken(endless.until(5), Rule::Execution);

  Workload w = two_tasks();
  w.dags[1].tasks[0].budget = 3 * kMillisecond;
  TraceBuilder cut(w);
  cut.at(0).arrives("hi", 0).arrives("lo", 0).dispatched("hi", 0, 0, 10).at(1).finished("hi", 0, 0);
  cut.dispatched("lo", 0, 0, 20);
  TraceBuilder good = cut;
  expect_kept(good.at(4).aborted("lo", 0, 0, Reason::Budget).until(5), Rule::Execution);
  expect_broken(cut.at(3).aborted("lo", 0, 0, Reason::Budget).until(5), Rule::Execution);
}

TEST(CheckTrace, RemovedDagsReleaseNothingMore) {
  TraceBuilder t = diamond_start();
  t.ready("aligned", 0, 0)
      .ready("slower", 0, 0)
      .released("data", 0)
      .ready("data", 0, 0)
      .dispatched("aligned", 0, 0, 10);
  t.at(2).skipped("slower", 0, Reason::Removed).skipped("data", 0, Reason::Removed).finished("aligned", 0, 0);
  expect_kept(t.until(50), Rule::Life);
}

TEST(CheckReport, CountsWhatItDoesNotKeep) {
  trace::Trace trace = two_tasks_run().until(10);
  for (int i = 0; i < 1000; ++i) trace.events.push_back(trace.events.back());
  const CheckReport report = check_trace(trace);
  EXPECT_EQ(report.violations.size(), CheckReport::kMaxKept);
  EXPECT_EQ(report.violation_count, 1001U);  // 1000 of them and one of conservation
  EXPECT_NE(report.to_string(2).find("and 999 more"), std::string::npos);
}

}  // namespace
}  // namespace redag::metrics
