// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Budgets and HI mode: for each rule a hand-written trace that keeps it and one that breaks it.
#include "redag_analysis/metrics/check/check_overload.hpp"

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

// hi: T 10, C 1. lo: T 20, C 4, budget 2. One worker; lo starts at 1.
TraceBuilder budget_run(OnBudget on_budget = OnBudget::Log) {
  Workload workload =
      make_workload({make_dag("a", {{"hi", 10, 1}}), make_dag("b", {{"lo", 20, 4}})}, 1, PreemptionMode::None);
  workload.dags[1].tasks[0].budget = 2 * kMillisecond;
  workload.dags[1].tasks[0].on_budget = on_budget;
  TraceBuilder t(workload);
  t.at(0).arrives("hi", 0).arrives("lo", 0).dispatched("hi", 0, 0, 10);
  t.at(1).finished("hi", 0, 0).dispatched("lo", 0, 0, 20);
  return t;
}

TEST(CheckBudgets, AJobIsToldWhenItHasUsedItsBudget) {
  expect_kept(budget_run().at(3).exceeded("lo", 0).at(5).finished("lo", 0, 0).until(6), Rule::Budget);
  expect_broken(budget_run().at(2).exceeded("lo", 0).at(5).finished("lo", 0, 0).until(6), Rule::Budget);
  expect_broken(budget_run().at(4).exceeded("lo", 0).at(5).finished("lo", 0, 0).until(6), Rule::Budget);
  expect_broken(budget_run().at(5).finished("lo", 0, 0).until(6), Rule::Budget);
}

TEST(CheckBudgets, OverheadsCanMakeItLate) {
  trace::Trace late = budget_run().at(4).exceeded("lo", 0).at(5).finished("lo", 0, 0).until(6);
  late.info.overheads = "dispatch 1ms";
  expect_kept(late, Rule::Budget);
  trace::Trace early = budget_run().at(2).exceeded("lo", 0).at(5).finished("lo", 0, 0).until(6);
  early.info.overheads = "dispatch 1ms";
  expect_broken(early, Rule::Budget);
}

TEST(CheckBudgets, OnThreadsTheTimeItUsedIsNotInTheTrace) {
  trace::Trace trace = budget_run().at(2).exceeded("lo", 0).at(5).started("lo", 0, 0).finished("lo", 0, 0).until(6);
  trace.info.driver = trace::Driver::Threads;
  expect_kept(trace, Rule::Budget);
}

TEST(CheckBudgets, OnlyWhatHasABudgetUsesIt) {
  TraceBuilder t = budget_run();
  t.at(3).exceeded("lo", 0).at(5).started("lo", 0, 0).finished("lo", 0, 0);
  t.at(10)
      .arrives("hi", 1)
      .dispatched("hi", 1, 0, 20)
      .at(11)
      .exceeded("hi", 1)
      .started("hi", 1, 0)
      .finished("hi", 1, 0);
  trace::Trace trace = t.until(12);
  trace.info.driver = trace::Driver::Threads;  // threads do not know the exact times that jobs used
  expect_broken(trace, Rule::Budget);
}

TEST(CheckBudgets, WhatIsCutOffDoesNotGoOn) {
  expect_broken(budget_run(OnBudget::Abort).at(3).exceeded("lo", 0).at(5).finished("lo", 0, 0).until(6), Rule::Budget);
}

TEST(CheckBudgets, AJobThatRunsUsesItsBudgetOnce) {
  expect_broken(budget_run().at(3).exceeded("lo", 0).exceeded("lo", 0).at(5).finished("lo", 0, 0).until(6), Rule::Life);
  TraceBuilder waits(make_workload({make_dag("a", {{"hi", 10, 1}}), make_dag("b", {{"lo", 20, 4}})}, 1));
  waits.at(0).arrives("hi", 0).arrives("lo", 0).dispatched("hi", 0, 0, 10).exceeded("lo", 0);
  expect_broken(waits.until(1), Rule::Life);
}

// h: T 20, C 9, C(LO) 2, high criticality. l: T 10, C 3. One worker; h starts at 3, and has used its 2 at 5.
Workload two_criticalities() {
  Workload workload =
      make_workload({make_dag("hi", {{"h", 20, 9}}), make_dag("lo", {{"l", 10, 3}})}, 1, PreemptionMode::Os);
  workload.dags[0].criticality = Criticality::High;
  workload.dags[0].tasks[0].wcet_low = 2 * kMillisecond;
  return workload;
}

TraceBuilder mode_run() {
  TraceBuilder t(two_criticalities());
  t.at(0).arrives("h", 0).arrives("l", 0).dispatched("l", 0, 0, 10);
  t.at(3).finished("l", 0, 0).dispatched("h", 0, 0, 20);
  return t;
}

TraceBuilder high_mode_run() {
  TraceBuilder t = mode_run();
  t.at(5).high_mode("h", 0);
  return t;
}

TraceBuilder high_mode_run_to_the_idle_instant() {
  TraceBuilder t = high_mode_run();
  t.at(10).released("l", 1).skipped("l", 1, Reason::Degraded).at(12).finished("h", 0, 0);
  return t;
}

TEST(CheckHighMode, BeginsWhenWcetLowIsUsedAndEndsWhenIdle) {
  expect_kept(high_mode_run_to_the_idle_instant().low_mode("h", 0, 5).until(15), Rule::Budget);
}

TEST(CheckHighMode, BeginsNeitherEarlyNorLate) {
  expect_broken(mode_run().at(4).high_mode("h", 0).until(6), Rule::Budget);
  expect_broken(mode_run().at(6).high_mode("h", 0).until(7), Rule::Budget);
  TraceBuilder never = mode_run();
  never.at(10).arrives("l", 1).preempted("h", 0, 0).dispatched("l", 1, 0, 20).at(13).finished("l", 1, 0);
  expect_broken(never.resumed("h", 0, 0).at(15).finished("h", 0, 0).until(16), Rule::Budget);
}

TEST(CheckHighMode, IsBegunByAStartedJobOfHighCriticality) {
  expect_broken(mode_run().at(3).high_mode("h", 7).until(4), Rule::Budget);
  TraceBuilder without_limit = mode_run();
  without_limit.at(10).arrives("l", 1).preempted("h", 0, 0).dispatched("l", 1, 0, 20);
  expect_broken(without_limit.at(12).high_mode("l", 1).until(13), Rule::Budget);
  Workload low = two_criticalities();
  low.dags[1].tasks[0].wcet_low = 2 * kMillisecond;  // no file can express this
  TraceBuilder by_low(low);
  by_low.at(0)
      .arrives("h", 0)
      .arrives("l", 0)
      .dispatched("l", 0, 0, 10)
      .at(2)
      .high_mode("l", 0)
      .skipped("h", 0, Reason::Removed);
  expect_broken(by_low.at(3).finished("l", 0, 0).low_mode("l", 0, 2).until(4), Rule::Budget);
}

TEST(CheckHighMode, EndsWhenNothingIsReadyOrStartedAndNoLater) {
  expect_broken(high_mode_run().at(8).low_mode("h", 0, 5).until(9), Rule::Budget);
  expect_broken(high_mode_run_to_the_idle_instant().until(15), Rule::Budget);
  expect_broken(high_mode_run_to_the_idle_instant().at(13).low_mode("h", 0, 5).until(15), Rule::Budget);
}

TEST(CheckHighMode, SaysWhenItBegan) {
  expect_broken(high_mode_run_to_the_idle_instant().low_mode("h", 0, 4).until(15), Rule::Budget);
}

TEST(CheckHighMode, EndsInTheNameOfTheJobThatBeganIt) {
  expect_broken(high_mode_run_to_the_idle_instant().low_mode("h", 1, 5).until(15), Rule::Budget);
  expect_broken(high_mode_run_to_the_idle_instant().low_mode("l", 0, 5).until(15), Rule::Budget);
}

TEST(CheckHighMode, BeginsAndEndsInTurn) {
  expect_broken(high_mode_run().high_mode("h", 0).until(6), Rule::Life);
  expect_broken(mode_run().at(5).low_mode("h", 0, 5).until(6), Rule::Life);
}

}  // namespace
}  // namespace redag::metrics
