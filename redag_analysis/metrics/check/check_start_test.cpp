// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Whether a dispatched job's body begins, on hand-written traces of real threads.
#include "redag_analysis/metrics/check/check_start.hpp"

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

constexpr Time kLate = kLateStart / kMillisecond;

Workload two_rates(PreemptionMode mode = PreemptionMode::Os) {
  return make_workload({make_dag("a", {{"hi", 1000, 1}}), make_dag("b", {{"lo", 2000, 400}})}, 2, mode);
}

// Both jobs have a worker from 0; lo's body begins soon.
TraceBuilder both(const Workload &workload) {
  TraceBuilder t(workload);
  t.at(0).arrives("hi", 0).arrives("lo", 0).dispatched("hi", 0, 0, 1000).dispatched("lo", 0, 1, 2000);
  t.at(1).started("lo", 0, 1);
  return t;
}

trace::Trace on_threads(trace::Trace trace) {
  trace.info.driver = trace::Driver::Threads;
  return trace;
}

TEST(CheckStart, ABodyThatBeginsWithinTheToleranceIsLawful) {
  TraceBuilder t = both(two_rates());
  t.at(kLate - 1).started("hi", 0, 0).at(kLate).finished("hi", 0, 0).at(2 * kLate).finished("lo", 0, 1);
  expect_kept(on_threads(t.until(3 * kLate)), Rule::Start);
}

TEST(CheckStart, ALessUrgentBodyThatEndsTooLateIsSeen) {
  TraceBuilder t = both(two_rates());
  t.at(kLate + 1).finished("lo", 0, 1);
  expect_broken(on_threads(t.until(kLate + 2)), Rule::Start);  // hi never began
  t.at(kLate + 2).started("hi", 0, 0).at(kLate + 3).finished("hi", 0, 0);
  expect_broken(on_threads(t.until(kLate + 4)), Rule::Start);
  EXPECT_EQ(check_trace(t.until(kLate + 4)).violated(Rule::Start), 0U)
      << "a simulated job begins when it is dispatched";
}

TEST(CheckStart, SoIsOneThatBeginsTooLate) {
  TraceBuilder t(two_rates());
  t.at(0).arrives("hi", 0).arrives("lo", 0).dispatched("hi", 0, 0, 1000).dispatched("lo", 0, 1, 2000);
  t.at(kLate + 1).started("lo", 0, 1).finished("hi", 0, 0);
  expect_broken(on_threads(t.until(kLate + 2)), Rule::Start);
}

// Only the stamps of a body prove that it ran; the scheduler's events alone show nothing.
TEST(CheckStart, ALessUrgentJobWhoseBodyIsNotSeenToRunProvesNothing) {
  TraceBuilder t = both(two_rates());
  t.at(2 * kLate).started("hi", 0, 0).at(2 * kLate + 1).finished("hi", 0, 0).finished("lo", 0, 1);
  expect_kept(on_threads(t.until(3 * kLate)), Rule::Start);
}

// The stamp of a begin can reach the trace after later events.
TEST(CheckStart, TheTimeOfTheBeginCountsAndNotWhenItWasTold) {
  TraceBuilder t = both(two_rates());
  t.at(2 * kLate).finished("lo", 0, 1).started("hi", 0, 0).at(2 * kLate + 1).finished("hi", 0, 0);
  trace::Trace trace = on_threads(t.until(3 * kLate));
  for (JobEvent &event : trace.events) {
    if (event.kind == JobEventKind::Started && event.task == t.id("hi")) event.value = kLate * kMillisecond;
  }
  expect_kept(trace, Rule::Start);
}

TEST(CheckStart, AsUrgentOrMoreUrgentBodiesMayRun) {
  TraceBuilder t(two_rates());
  t.at(0).arrives("hi", 0).arrives("lo", 0).dispatched("hi", 0, 0, 1000).dispatched("lo", 0, 1, 2000);
  t.started("hi", 0, 0).at(2 * kLate).finished("hi", 0, 0).at(3 * kLate).started("lo", 0, 1).finished("lo", 0, 1);
  expect_kept(on_threads(t.until(4 * kLate)), Rule::Start);

  trace::Trace shared = on_threads(both(two_rates()).at(2 * kLate).finished("lo", 0, 1).until(3 * kLate));
  expect_broken(shared, Rule::Start);
  shared.info.config.levels = 1;
  EXPECT_EQ(check_trace(shared).violated(Rule::Start), 0U);
}

TEST(CheckStart, WithoutPreemptionTheSystemDecidesWhichThreadRuns) {
  TraceBuilder t = both(two_rates(PreemptionMode::None));
  t.at(2 * kLate).finished("lo", 0, 1);
  EXPECT_EQ(check_trace(on_threads(t.until(3 * kLate))).checks(Rule::Start), 0U);
}

}  // namespace
}  // namespace redag::metrics
