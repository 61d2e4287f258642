// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Preemption and inheritance: for each rule a hand-written trace that keeps it and one that breaks it.
#include "redag_analysis/metrics/check/check_dispatch.hpp"

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

// lo runs from 0; hi arrives at 5 (its offset).
TraceBuilder preemptive(PreemptionMode mode, Duration region_ms = 0) {
  Workload w = make_workload({make_dag("a", {{"hi", 10, 1, {}, "", 5}}), make_dag("b", {{"lo", 20, 8}})}, 1, mode);
  w.dags[1].tasks[0].region = region_ms * kMillisecond;
  TraceBuilder t(w);
  t.at(0).arrives("lo", 0).dispatched("lo", 0, 0, 20).at(5).arrives("hi", 0);
  return t;
}

TEST(CheckTrace, FullPreemption) {
  TraceBuilder good = preemptive(PreemptionMode::Os);
  good.preempted("lo", 0, 0).dispatched("hi", 0, 0, 15).at(6).finished("hi", 0, 0).resumed("lo", 0, 0);
  good.at(9).finished("lo", 0, 0);
  expect_kept(good.until(10), Rule::Preemption);

  expect_broken(preemptive(PreemptionMode::Os).until(6), Rule::Priority);  // hi waits
  TraceBuilder nobody = preemptive(PreemptionMode::Os);
  expect_broken(nobody.preempted("lo", 0, 0).until(6), Rule::WorkConservation);
  expect_broken(nobody.until(6), Rule::Preemption);
  TraceBuilder not_here = preemptive(PreemptionMode::None);
  expect_broken(not_here.preempted("lo", 0, 0).dispatched("hi", 0, 0, 15).until(6), Rule::Preemption);
  TraceBuilder forgotten = preemptive(PreemptionMode::Os);
  forgotten.preempted("lo", 0, 0).dispatched("hi", 0, 0, 15).at(6).finished("hi", 0, 0);
  expect_broken(forgotten.until(8), Rule::WorkConservation);
  TraceBuilder ended = preemptive(PreemptionMode::Os);
  ended.preempted("lo", 0, 0).dispatched("hi", 0, 0, 15).finished("lo", 0, 0);
  expect_broken(ended.until(6), Rule::Life);
}

TEST(CheckTrace, OnlyTheMoreUrgentPreempt) {
  TraceBuilder t(make_workload({make_dag("a", {{"hi", 10, 5}}), make_dag("b", {{"lo", 20, 4, {}, "", 2}})}, 1,
                               PreemptionMode::Os));
  t.at(0).arrives("hi", 0).dispatched("hi", 0, 0, 10).at(2).arrives("lo", 0);
  t.preempted("hi", 0, 0).dispatched("lo", 0, 0, 22);
  expect_broken(t.until(3), Rule::Preemption);
  expect_broken(t.until(3), Rule::Priority);
}

TEST(CheckTrace, OfEqualsTheEarlierReleaseGoesFirst) {
  Workload w = make_workload({make_dag("a", {{"one", 10, 5, {}, "", 2}, {"two", 10, 5, {}, "", 1}, {"busy", 30, 3}})},
                             1, PreemptionMode::None);
  for (const Ties ties : {Ties::Share, Ties::Fixed}) {
    w.ties = ties;
    TraceBuilder t(w);
    t.at(0).arrives("busy", 0).dispatched("busy", 0, 0, 30).at(1).arrives("two", 0).at(2).arrives("one", 0);
    t.at(3).finished("busy", 0, 0);
    TraceBuilder one = t;
    one.dispatched("one", 0, 0, 12);
    TraceBuilder two = t;
    two.dispatched("two", 0, 0, 11);
    const bool share = ties == Ties::Share;
    expect_kept((share ? two : one).until(4), Rule::Priority);
    expect_broken((share ? one : two).until(4), Rule::Priority);
  }
}

TEST(CheckTrace, AJobThatTakesAPlaceHasItsTurn) {
  const Workload w = make_workload({make_dag("a", {{"heavy", 20, 25}, {"light", 20, 5}})}, 1, PreemptionMode::None);
  TraceBuilder t(w);
  t.at(0).arrives("heavy", 0).arrives("light", 0).dispatched("heavy", 0, 0, 20);
  t.at(20).arrives("heavy", 1).released("light", 1).skipped("light", 0, Reason::Overrun).ready("light", 1, 20);
  t.at(25).finished("heavy", 0, 0);
  TraceBuilder fair = t;
  expect_kept(fair.dispatched("light", 1, 0, 40).until(26), Rule::Priority);
  expect_broken(t.dispatched("heavy", 1, 0, 40).until(26), Rule::Priority);
}

TEST(CheckTrace, TheTurnOfADataTaskIsTheOriginOfItsData) {
  Workload w = make_workload({make_dag("a", {{"first", 10, 2}, {"second", 0, 2, {0}}, {"other", 10, 2}})}, 1,
                             PreemptionMode::None);
  w.dags[0].tasks[2].offset = kMillisecond;
  TraceBuilder t(w);
  t.at(0).arrives("first", 0).dispatched("first", 0, 0, 10).at(1).arrives("other", 0);
  t.at(2).finished("first", 0, 0).released("second", 0).ready("second", 0, 0);
  TraceBuilder chain = t;
  expect_kept(chain.dispatched("second", 0, 0, 12).until(3), Rule::Priority);
  expect_broken(t.dispatched("other", 0, 0, 11).until(3), Rule::Priority);
}

TEST(CheckTrace, ATurnIsKeptWhileAJobWaitsForData) {
  const Workload w =
      make_workload({make_dag("a", {{"heavy", 20, 25}, {"p", 20, 1}, {"q", 20, 2, {1}}})}, 1, PreemptionMode::None);
  TraceBuilder t(w);
  t.at(0).arrives("heavy", 0).arrives("p", 0).released("q", 0).dispatched("heavy", 0, 0, 20);
  t.at(20).arrives("heavy", 1).released("p", 1).skipped("p", 0, Reason::Overrun).ready("p", 1, 20);
  t.released("q", 1).skipped("q", 0, Reason::Precedence);
  t.at(25).finished("heavy", 0, 0).dispatched("p", 1, 0, 40).at(26).finished("p", 1, 0).ready("q", 1, 20);
  TraceBuilder kept = t;
  expect_kept(kept.dispatched("q", 1, 0, 40).until(27), Rule::Priority);
  expect_broken(t.dispatched("heavy", 1, 0, 40).until(27), Rule::Priority);
}

TEST(CheckTrace, EqualsDoNotPreemptAndGoOnFirst) {
  Workload w = make_workload({make_dag("a", {{"hi", 5, 1, {}, "", 2}, {"one", 20, 4, {}, "", 1}, {"two", 20, 9}})}, 1,
                             PreemptionMode::Os);
  TraceBuilder t(w);
  t.at(0).arrives("two", 0).dispatched("two", 0, 0, 20).at(1).arrives("one", 0);
  TraceBuilder preempts = t;
  preempts.preempted("two", 0, 0).dispatched("one", 0, 0, 21);
  expect_broken(preempts.until(2), Rule::Preemption);
  t.at(2).arrives("hi", 0).preempted("two", 0, 0).dispatched("hi", 0, 0, 7).at(3).finished("hi", 0, 0);
  TraceBuilder goes_on = t;
  expect_kept(goes_on.resumed("two", 0, 0).until(4), Rule::Priority);
  expect_broken(t.dispatched("one", 0, 0, 21).until(4), Rule::Priority);
}

TEST(CheckTrace, EndsOfOneInstantAreInTheOrderOfTasks) {
  const Workload w =
      make_workload({make_dag("a", {{"last", 0, 5, {1}}, {"first", 10, 5}}), make_dag("b", {{"other", 10, 5}})}, 2);
  TraceBuilder t(w);
  t.at(0).arrives("first", 0).arrives("other", 0).dispatched("first", 0, 0, 10).dispatched("other", 0, 1, 10).at(5);
  TraceBuilder good = t;
  good.finished("first", 0, 0).released("last", 0).ready("last", 0, 0).finished("other", 0, 1);
  expect_kept(good.dispatched("last", 0, 0, 15).until(6), Rule::Precedence);
  TraceBuilder bad = t;
  bad.finished("other", 0, 1).finished("first", 0, 0).released("last", 0).ready("last", 0, 0);
  bad.dispatched("last", 0, 0, 15);
  expect_broken(bad.until(6), Rule::Precedence);
  trace::Trace threads = bad.until(6);
  threads.info.driver = trace::Driver::Threads;
  expect_kept(threads, Rule::Precedence);
}

TEST(CheckTrace, TasksThatShareALevelDoNotPreempt) {
  TraceBuilder waits = preemptive(PreemptionMode::Os);
  trace::Trace shared = waits.until(6);
  shared.info.config.levels = 1;
  expect_kept(shared, Rule::Priority);
  trace::Trace preempts = waits.preempted("lo", 0, 0).dispatched("hi", 0, 0, 15).until(6);
  preempts.info.config.levels = 1;
  expect_broken(preempts, Rule::Preemption);
}

TEST(CheckTrace, CooperativePreemptionAtPointsAndLifo) {
  TraceBuilder good = preemptive(PreemptionMode::Cooperative, 3);  // points at 3 and 6
  good.at(6).preempted("lo", 0, 0).dispatched("hi", 0, 0, 15).at(7).finished("hi", 0, 0).resumed("lo", 0, 0);
  good.at(9).finished("lo", 0, 0);
  expect_kept(good.until(10), Rule::Preemption);

  TraceBuilder between = preemptive(PreemptionMode::Cooperative, 3);
  expect_broken(between.preempted("lo", 0, 0).dispatched("hi", 0, 0, 15).until(6), Rule::Preemption);
  TraceBuilder not_last = preemptive(PreemptionMode::Cooperative, 3);
  not_last.at(6).preempted("lo", 0, 0).dispatched("hi", 0, 0, 15).finished("lo", 0, 0);
  expect_broken(not_last.until(7), Rule::Life);
  TraceBuilder idle = preemptive(PreemptionMode::Cooperative, 3);
  idle.at(6).preempted("lo", 0, 0).dispatched("hi", 0, 0, 15).at(7).finished("hi", 0, 0);
  expect_broken(idle.until(8), Rule::WorkConservation);
}

TEST(CheckTrace, CooperativeResumesOnlyBelowEverybodyElse) {
  Workload w = make_workload(
      {make_dag("a", {{"h1", 10, 2, {}, "", 5}, {"h2", 10, 2, {}, "", 6}}), make_dag("b", {{"lo", 20, 9}})}, 1,
      PreemptionMode::Cooperative);
  w.dags[1].tasks[0].region = 5 * kMillisecond;
  TraceBuilder t(w);
  t.at(0).arrives("lo", 0).dispatched("lo", 0, 0, 20).at(5).arrives("h1", 0);
  t.preempted("lo", 0, 0).dispatched("h1", 0, 0, 15).at(6).arrives("h2", 0).at(7).finished("h1", 0, 0);
  TraceBuilder good = t;
  good.dispatched("h2", 0, 0, 16).at(9).finished("h2", 0, 0).resumed("lo", 0, 0);
  expect_kept(good.until(10), Rule::Priority);
  expect_broken(t.resumed("lo", 0, 0).until(8), Rule::Priority);
}

TEST(CheckTrace, CooperativePrefersAFreeWorker) {
  Workload w = make_workload({make_dag("a", {{"hi", 10, 1, {}, "", 5}}), make_dag("b", {{"lo", 20, 8}})}, 2,
                             PreemptionMode::Cooperative);
  w.dags[1].tasks[0].region = 5 * kMillisecond;
  TraceBuilder t(w);
  t.at(0).arrives("lo", 0).dispatched("lo", 0, 0, 20).at(5).arrives("hi", 0);
  expect_broken(t.preempted("lo", 0, 0).dispatched("hi", 0, 0, 15).until(6), Rule::Priority);
}

// lo holds the group that hi needs; mid must not run in between (one worker, full preemption).
TEST(CheckTrace, PriorityIsInherited) {
  const Workload w =
      make_workload({make_dag("a", {{"hi", 10, 1, {}, "g", 1}}), make_dag("b", {{"mid", 15, 3, {}, "", 2}}),
                     make_dag("c", {{"lo", 20, 4, {}, "g"}})},
                    1, PreemptionMode::Os);
  TraceBuilder t(w);
  t.at(0).arrives("lo", 0).dispatched("lo", 0, 0, 20).at(1).arrives("hi", 0).at(2).arrives("mid", 0);
  TraceBuilder good = t;
  good.at(4).finished("lo", 0, 0).dispatched("hi", 0, 0, 11).at(5).finished("hi", 0, 0).dispatched("mid", 0, 0, 17);
  expect_kept(good.until(6), Rule::Priority);
  expect_broken(t.preempted("lo", 0, 0).dispatched("mid", 0, 0, 17).until(3), Rule::Priority);

  // mid arrives first: lo takes the worker back only when hi waits for lo's group.
  Workload late = w;
  late.dags[0].tasks[0].offset = 3 * kMillisecond;
  TraceBuilder back(late);
  back.at(0).arrives("lo", 0).dispatched("lo", 0, 0, 20).at(2).arrives("mid", 0);
  back.preempted("lo", 0, 0).dispatched("mid", 0, 0, 17).at(3);
  TraceBuilder inherits = back;
  inherits.arrives("hi", 0).preempted("mid", 0, 0).resumed("lo", 0, 0);
  expect_kept(inherits.until(4), Rule::Preemption);
  expect_broken(back.preempted("mid", 0, 0).resumed("lo", 0, 0).until(4), Rule::Preemption);
}

// Threads decide more than once at one instant of their clocks. What lo inherits after mid took its worker does not
// undo that step where lo cannot return at once (cooperative; a level that it shares with mid).
//
// Two equals arrive together, and one of them waits for the group of the running job. If the other one is looked at
// first, the holder has inherited nothing yet. Otherwise the other one is of the holder's level.
TEST(CheckTrace, AJobInheritsWhenTheOneThatWaitsIsLookedAt) {
  for (const bool waits_first : {false, true}) {
    const redag::testing::TestTask waits{"waits", 10, 2, {}, "g", 5};
    const redag::testing::TestTask equal{"equal", 10, 2, {}, "", 5};
    const Dag urgent = waits_first ? make_dag("a", {waits, equal}) : make_dag("a", {equal, waits});
    TraceBuilder t(make_workload({urgent, make_dag("b", {{"holds", 30, 9, {}, "g"}})}, 1, PreemptionMode::Os));
    t.at(0).arrives("holds", 0).dispatched("holds", 0, 0, 30).at(5).arrives("equal", 0).arrives("waits", 0);
    t.preempted("holds", 0, 0).dispatched("equal", 0, 0, 15);
    waits_first ? expect_broken(t.until(6), Rule::Priority) : expect_kept(t.until(6), Rule::Priority);
  }
}

TEST(CheckTrace, WhatIsInheritedTooLateKeepsNobodyFromPreempting) {
  for (const PreemptionMode mode : {PreemptionMode::Cooperative, PreemptionMode::Os}) {
    Workload w = make_workload({make_dag("a", {{"hi", 10, 1, {}, "g", 5}}), make_dag("b", {{"mid", 15, 3, {}, "", 5}}),
                                make_dag("c", {{"lo", 20, 9, {}, "g"}})},
                               1, mode);
    w.dags[2].tasks[0].region = 5 * kMillisecond;
    const auto run = [&](bool too_late) {
      TraceBuilder t(w);
      t.at(0).arrives("lo", 0).dispatched("lo", 0, 0, 20).at(5).arrives("mid", 0);
      if (!too_late) t.arrives("hi", 0);
      t.preempted("lo", 0, 0).dispatched("mid", 0, 0, 20);
      if (too_late) t.arrives("hi", 0);
      trace::Trace trace = t.until(6);
      if (mode == PreemptionMode::Os) trace.info.config.levels = 2;  // hi and mid share one
      return trace;
    };
    expect_kept(run(true), Rule::Preemption);
    expect_broken(run(false), Rule::Preemption);
  }
}

}  // namespace
}  // namespace redag::metrics
