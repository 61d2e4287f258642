// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/cli/analyze/analysis_explanation.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <utility>

#include "redag/loader/workload_yaml.hpp"
#include "tests/testing/builders.hpp"

namespace redag::cli {
namespace {

using analysis::Term;
using ::testing::HasSubstr;
using testing::make_dag;
using testing::make_workload;
using ::testing::Not;
using Kind = Term::Kind;

lab::Analysed look_at(const Workload &workload) {
  Result<lab::Analysed> analysed = lab::analyse(workload, analysis::platform_of(workload));
  EXPECT_TRUE(analysed) << to_string(analysed.error());
  return *std::move(analysed);
}

// Returns two tasks on one worker: fast.a (T 10, C 3) and slow.b (T 20, C 7, with a preemption point every
// millisecond).
lab::Analysed two_tasks(PreemptionMode mode) {
  Workload workload = make_workload({make_dag("fast", {{"a", 10, 3}}), make_dag("slow", {{"b", 20, 7}})}, 1, mode);
  workload.dags[1].tasks[0].region = kMillisecond;
  return look_at(workload);
}

lab::Row row_of(const lab::Analysed &analysed, const std::string &name) {
  Result<lab::Row> row = find_row(analysed, name);
  EXPECT_TRUE(row) << to_string(row.error());
  return *std::move(row);
}

Term term(Kind kind, Duration ms, TaskId task = {}, std::int64_t jobs = 0) {
  Term made;
  made.kind = kind;
  made.task = task;
  made.amount = ms * kMillisecond;
  made.jobs = jobs;
  return made;
}

// Returns the explanation of slow.b, which may miss, if `largest` is 6 of its 10 ms.
std::string explained(const Term &largest, PreemptionMode mode = PreemptionMode::Os) {
  const lab::Analysed analysed = two_tasks(mode);
  lab::Row row = row_of(analysed, "slow.b");
  row.tightest.response = row.tightest.bound.response = 10 * kMillisecond;
  row.tightest.bound.terms = {term(Kind::Own, 4, TaskId(1), 1), largest};
  row.standing = lab::Standing::MayMiss;
  return explain(analysed, row, StreamTraits{});
}

TEST(Explanation, TermsAddUpAndTheLargestIsNamed) {
  const lab::Analysed analysed = two_tasks(PreemptionMode::None);
  // Without preemption, a waits only for b: 7 ms, of which at least one nanosecond has passed.
  const lab::Row row = row_of(analysed, "fast/a");
  EXPECT_EQ(row.tightest.response, 10 * kMillisecond - 1);
  const std::string text = explain(analysed, row, StreamTraits{});
  EXPECT_THAT(text, HasSubstr("blocking by    slow.b     1   7ms  70.0 %"));
  EXPECT_THAT(text, HasSubstr("own execution  fast.a     1   3ms  30.0 %"));
}

TEST(Explanation, OfATaskThatIsOkAdvisesNoChange) {
  const lab::Analysed analysed = two_tasks(PreemptionMode::Os);
  const lab::Row row = row_of(analysed, "fast.a");
  EXPECT_EQ(row.standing, lab::Standing::Ok);
  const std::string text = explain(analysed, row, StreamTraits{});
  EXPECT_THAT(text, HasSubstr("the largest contribution is 3ms of 3ms (100.0 %); nothing needs to change\n"));
  EXPECT_THAT(text, Not(HasSubstr("what to change")));
  EXPECT_THAT(text, Not(HasSubstr("helps most")));
}

// A task of 1 precedes three parallel tasks of 4 on two workers. The longest path L is 5, and
// L + (V - L) / m = 5 + 8 / 2.
TEST(Explanation, OfADagOnSeveralWorkersTellsThePathFromTheRest) {
  const Dag fork =
      make_dag("fork", {{"first", 10, 1}, {"left", 0, 4, {0}}, {"right", 0, 4, {0}}, {"third", 0, 4, {0}}});
  const lab::Analysed analysed = look_at(make_workload({fork}, 2, PreemptionMode::Os));
  const lab::Row row = row_of(analysed, "fork.right");
  EXPECT_EQ(row.tightest.response, 9 * kMillisecond);
  EXPECT_EQ(row.tightest.response, row_of(analysed, "fork").tightest.response);
  const std::string text = explain(analysed, row, StreamTraits{});
  EXPECT_THAT(text, HasSubstr("own execution                          fork     1   5ms  55.6 %"));
  EXPECT_THAT(text, HasSubstr("its other tasks, off the longest path  fork     -   4ms  44.4 %"));
}

TEST(Explanation, OfEachKindOfTermSaysWhatItIsAndWhatHelps) {
  struct Case {
    Term largest;
    const char *what;
    const char *advice;
  };
  const TaskId a(0);
  const Case cases[] = {
      {term(Kind::Own, 6, TaskId(1), 1), "own execution", "a smaller wcet of its own helps most"},
      {term(Kind::Own, 6, TaskId(1)), "its other tasks, off the longest path", "a larger max_active help most"},
      {term(Kind::Earlier, 6, TaskId(1), 1), "its own earlier jobs", "a smaller wcet or a longer period helps most"},
      {term(Kind::Blocking, 6, a, 1), "blocking by", "fast.a holds a group or shares a priority level"},
      {term(Kind::Blocking, 6), "less urgent work", "less urgent work holds a group"},
      {term(Kind::Interference, 6, a, 2), "interference by", "fast.a is released 2 times before it ends"},
      {term(Kind::Interference, 6, a, 1), "interference by", "fast.a runs first: shorten it"},
      {term(Kind::Interference, 6), "more urgent work", "more urgent work runs first"},
      {term(Kind::Jitter, 6), "release jitter", "less release jitter helps most"},
      {term(Kind::Wait, 6), "waiting for data of other rates", "response time of its predecessors helps most"},
      {term(Kind::Suspended, 6), "waits without a device", "a shorter wait helps most"},
      {term(Kind::Overhead, 6), "overhead", "fewer and longer jobs, or smaller scheduling overheads, help most"},
  };
  for (const Case &c : cases) {
    const std::string text = explained(c.largest);
    EXPECT_THAT(text, HasSubstr(c.what));
    EXPECT_THAT(text, HasSubstr("the largest contribution is 6ms of 10ms (60.0 %): "));
    EXPECT_THAT(text, HasSubstr(c.advice));
  }
}

TEST(Explanation, OfBlockingDependsOnHowTheBlockerCanBePreempted) {
  const Term blocking = term(Kind::Blocking, 6, TaskId(0), 1);
  EXPECT_THAT(explained(blocking, PreemptionMode::None), HasSubstr("fast.a keeps its worker until it ends"));
  EXPECT_THAT(explained(blocking, PreemptionMode::Cooperative), HasSubstr("until its next preemption point"));
}

TEST(Explanation, OfAUnitOfSeveralTasksNamesItsDag) {
  Term of_dag = term(Kind::Interference, 6, {}, 1);
  of_dag.dag = DagId(0);
  EXPECT_THAT(explained(of_dag), HasSubstr("fast runs first"));
}

TEST(Explanation, WhatIsTakenOffHasNoShareAndWhatIsNothingNoRow) {
  const std::string text = explained(term(Kind::Earlier, -1, TaskId(1), 1));
  EXPECT_THAT(text, HasSubstr("time since earlier jobs were released"));
  EXPECT_THAT(text, HasSubstr("-1ms"));
  EXPECT_THAT(text, HasSubstr("the largest contribution is 4ms of 10ms"));
  EXPECT_THAT(explained(term(Kind::Jitter, 0)), Not(HasSubstr("release jitter")));
}

TEST(Explanation, SaysWhenADeadlineBeyondThePeriodCannotBeUsed) {
  const lab::Analysed analysed = two_tasks(PreemptionMode::Os);
  Result<lab::Row> row = find_row(analysed, "slow/b");
  ASSERT_TRUE(row);
  row->deadline = 30 * kMillisecond;
  row->due = 20 * kMillisecond;
  EXPECT_THAT(explain(analysed, *row, StreamTraits{}),
              HasSubstr("judged at 20ms: after that, the next release would skip"));
}

TEST(Explanation, NamesTheLineThatIsInTheWay) {
  const std::string text = R"(platform: {workers: 1, preemption: os}
dags:
  - name: a
    tasks:
      - name: t
        wcet: 2ms
        period: 10ms
        budget: 1ms
  - name: b
    tasks: [{name: t, wcet: 1ms, period: 20ms, budget: 500us}]
)";
  const Result<LoadedWorkload> loaded = parse_workload(text, "case.yaml");
  ASSERT_TRUE(loaded) << to_string(loaded.error());
  const lab::Analysed analysed = look_at(loaded->workload);
  const SourceText source{"case.yaml", text, {DagId(0), DagId(1)}};
  EXPECT_THAT(explain(analysed, row_of(analysed, "a.t"), StreamTraits{}, source),
              HasSubstr("in the way: case.yaml:8: budget of a.t; without it: ok, response time at most 2ms\n"));
  // The more urgent task takes nothing from b.t, whose own budget does.
  EXPECT_THAT(explain(analysed, row_of(analysed, "b.t"), StreamTraits{}, source),
              HasSubstr("in the way: case.yaml:10: budget of b.t; without it: ok, response time at most 3ms\n"));
}

}  // namespace
}  // namespace redag::cli
