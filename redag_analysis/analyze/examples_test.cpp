// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Published examples with the numbers of their authors, and hand-made ones.
#include <gtest/gtest.h>

#include <map>

#include "redag_analysis/analyze/analyze.hpp"
#include "redag_analysis/one_worker/edf_demand.hpp"
#include "redag_analysis/one_worker/paper.hpp"
#include "redag_analysis/one_worker/response_time.hpp"
#include "tests/testing/bound_property.hpp"
#include "tests/testing/builders.hpp"

namespace redag::analysis {
namespace {

using testing::compiled;
using testing::Load;

Workload in_one_dag(const std::vector<Load> &loads, PolicyKind policy = PolicyKind::RateMonotonic) {
  std::vector<testing::TestTask> tasks;
  for (const Load &load : loads) {
    const std::string name = "t" + std::to_string(tasks.size());
    tasks.push_back({.name = name, .period = load.period, .wcet = load.wcet, .deadline = load.deadline});
  }
  return testing::make_workload({testing::tick_dag("d", tasks)}, 1, PreemptionMode::Auto, policy);
}

std::vector<Duration> responses(const Method &method, const TaskSet &task_set) {
  const Outcome outcome = method.apply(task_set);
  EXPECT_TRUE(std::holds_alternative<Bound>(outcome)) << std::get<NotApplicable>(outcome).reason;
  std::vector<Duration> found;
  for (const ResponseBound &bound : std::get<Bound>(outcome).tasks) found.push_back(bound.response.value_or(-1));
  return found;
}

std::vector<Duration> responses(const Method &method, const std::vector<Load> &tasks, sched::Preemption preemption) {
  return responses(method, compiled(in_one_dag(tasks), preemption));
}

bool accepts(const Method &method, const TaskSet &task_set) {
  const Outcome outcome = method.apply(task_set);
  EXPECT_TRUE(std::holds_alternative<Bound>(outcome)) << std::get<NotApplicable>(outcome).reason;
  return std::get<Bound>(outcome).accepts.value();
}

using Durations = std::vector<Duration>;
constexpr auto kFull = sched::Preemption::Full;
constexpr auto kNone = sched::Preemption::None;

// A. Burns, A. Wellings, Real-Time Systems and Programming Languages, the task set of the response-time chapter.
TEST(Examples, BurnsWellings) {
  EXPECT_EQ(responses(rta_preemptive(), {{3, 7}, {3, 12}, {5, 20}}, kFull), (Durations{3, 6, 20}));
}

// J. Lehoczky, L. Sha, Y. Ding, RTSS 1989, the example of the exact criterion: accepted although U = 0.953.
TEST(Examples, LehoczkyShaDing) {
  const std::vector<Load> tasks = {{40, 100}, {40, 150}, {100, 350}};
  EXPECT_EQ(responses(rta_preemptive(), tasks, kFull), (Durations{40, 80, 300}));
}

// J. Lehoczky, RTSS 1990: with deadlines above the period the first job is not the worst: 114, 102, 116, 104, 118, ...
TEST(Examples, LehoczkyArbitraryDeadlines) {
  Workload workload = in_one_dag({{26, 70}, {62, 100, 200}});
  workload.dags[0].tasks[1].overrun = Overrun::Queue;
  workload.dags[0].tasks[1].queue_depth = 2;
  const TaskSet task_set = compiled(workload, kFull);
  EXPECT_EQ(responses(rta_preemptive(), task_set), (Durations{26, 118}));
  const Outcome outcome = rta_preemptive().apply(task_set);
  const ResponseBound &bound = std::get<Bound>(outcome).tasks[1];
  EXPECT_EQ(bound.sum(Term::Kind::Earlier), 4 * (62 - 100)) << "the fifth job of the busy period";
  EXPECT_EQ(bound.sum(Term::Kind::Interference), 26 * 8);

  // With `skip` the fifth job is not reached: the response exceeds the period, where the bound ends.
  workload.dags[0].tasks[1].overrun = Overrun::Skip;
  EXPECT_EQ(responses(rta_preemptive(), compiled(workload, kFull)), (Durations{26, -1}));
}

// R. Davis, A. Burns, R. Bril, J. Lukkien, RTS 35(3), 2007: the flaw of the old CAN analysis. R = 2, 3, 3.5 in dense
// time. In units of 1/1000 blocking is one unit less, because its cause starts at an instant strictly before.
TEST(Examples, DavisBurnsBrilLukkien) {
  const std::vector<Load> tasks = {{1000, 2500, 2500}, {1000, 3500, 3250}, {1000, 3500, 3250}};
  Workload workload = in_one_dag(tasks);
  EXPECT_EQ(responses(rta_nonpreemptive(), compiled(workload, kNone)), (Durations{1999, 3500, 3500})) << "two equals";
  workload.ties = Ties::Fixed;
  const TaskSet task_set = compiled(workload, kNone);
  EXPECT_EQ(responses(rta_nonpreemptive(), task_set), (Durations{1999, 2999, 3500}));
  EXPECT_EQ(verdict(task_set, std::get<Bound>(rta_nonpreemptive().apply(task_set))), Verdict::NotShown);
}

TEST(Examples, HarmonicPeriodsFillTheProcessor) {
  const std::vector<Load> full = {{1, 3}, {1, 6}, {6, 12}};
  EXPECT_EQ(responses(rta_preemptive(), full, kFull), (Durations{1, 2, 12})) << "U = 1 exactly, in thirds";
}

// By hand: a job of 20 that started just before holds the only worker for 19 more.
TEST(Examples, RunToCompletionBlocksTheMostUrgent) {
  const std::vector<Load> tasks = {{1, 10}, {20, 100}};
  EXPECT_EQ(responses(rta_nonpreemptive(), tasks, kNone)[0], -1) << "20 > 10: jobs would be skipped";
  EXPECT_EQ(responses(rta_nonpreemptive(), {{1, 30}, {20, 100}}, kNone)[0], 20);
  EXPECT_EQ(responses(paper_rta(), {{1, 30}, {20, 100}}, kNone)[0], 1) << "what the paper's equation says";
  EXPECT_EQ(responses(paper_rta_blocking(), {{1, 30}, {20, 100}}, kNone)[0], 20);
}

// Regions of 4 in a job of 10: 3 units of blocking, and the last region of 2 is not interrupted.
TEST(Examples, DeferredPreemption) {
  Workload workload = in_one_dag({{2, 20}, {10, 40}});
  workload.dags[0].tasks[1].region = 4;
  const TaskSet task_set = compiled(workload, sched::Preemption::Cooperative);
  EXPECT_EQ(task_set.tasks[1].last_region, 2);
  EXPECT_EQ(responses(rta_deferred(), task_set), (Durations{5, 12}));
}

TEST(Examples, ThePapersEquationsAreOptimistic) {
  const TaskSet repeats = compiled(in_one_dag({{1, 4}, {5, 20}}), kFull);
  EXPECT_EQ(responses(paper_interference(), repeats), (Durations{1, 6}));
  EXPECT_EQ(responses(rta_preemptive(), repeats), (Durations{1, 7}));
  EXPECT_NE(std::get<Bound>(paper_interference().apply(repeats)).unsound, "");
  EXPECT_EQ(std::get<Bound>(paper_rta().apply(repeats)).unsound, "");

  const TaskSet ties = compiled(in_one_dag({{5, 10}, {5, 10}}), kFull);
  EXPECT_EQ(responses(paper_rta(), ties), (Durations{5, 5}));
  EXPECT_EQ(responses(rta_preemptive(), ties), (Durations{10, 10}));
  EXPECT_NE(std::get<Bound>(paper_rta().apply(ties)).unsound, "");
}

// U = 1 fits; 13 units due within 12 do not, nor does a blocking job that is one unit too long.
TEST(Examples, EdfDemand) {
  EXPECT_TRUE(accepts(edf_demand(), compiled(in_one_dag({{2, 4}, {7, 14}}, PolicyKind::Edf), kFull)));
  EXPECT_FALSE(accepts(edf_demand(), compiled(in_one_dag({{2, 4}, {7, 14, 12}}, PolicyKind::Edf), kFull)));
  EXPECT_TRUE(accepts(edf_demand_nonpreemptive(), compiled(in_one_dag({{1, 2}, {2, 10}}, PolicyKind::Edf), kNone)));
  EXPECT_FALSE(accepts(edf_demand_nonpreemptive(), compiled(in_one_dag({{1, 2}, {3, 10}}, PolicyKind::Edf), kNone)));
}

// Groups: the holder finishes at the priority of the waiting task, and delays the tasks between the two.
TEST(Examples, BlockingByAGroupReachesTheTasksBetween) {
  Workload workload = in_one_dag({{1, 20}, {2, 40}, {6, 80}});
  workload.dags[0].tasks[0].group = workload.dags[0].tasks[2].group = "shared";
  const TaskSet task_set = compiled(workload, kFull);
  EXPECT_EQ(responses(rta_preemptive(), task_set), (Durations{1 + 5, 2 + 1 + 5, 6 + 1 + 2}));
  const Bound bound = std::get<Bound>(rta_preemptive().apply(task_set));
  const Term blocking{Term::Kind::Blocking, TaskId(2), DagId(0), 5, 1};
  EXPECT_NE(std::find(bound.tasks[1].terms.begin(), bound.tasks[1].terms.end(), blocking), bound.tasks[1].terms.end());
}

TEST(Examples, OverheadsAreCharged) {
  AnalysisPlatform platform;
  platform.release_overhead = 1;
  platform.dispatch_overhead = 2;
  platform.preempt_overhead = 3;
  const TaskSet task_set = compiled(in_one_dag({{4, 30}, {10, 60}}), platform);
  EXPECT_EQ(responses(rta_preemptive(), task_set), (Durations{10, 26}));
  const Bound bound = std::get<Bound>(rta_preemptive().apply(task_set));
  EXPECT_EQ(bound.tasks[1].sum(Term::Kind::Overhead), 6);
  EXPECT_EQ(bound.tasks[1].sum(Term::Kind::Own), 10);
  EXPECT_EQ(bound.tasks[1].sum(Term::Kind::Interference), 10);
}

TEST(Examples, DagsOnOneWorker) {
  Workload workload = testing::make_workload(
      {testing::make_dag("fast", {{.name = "a", .period = 20, .wcet = 2}, {.name = "b", .wcet = 1, .after = {0}}}),
       testing::make_dag("slow", {{.name = "c", .period = 100, .wcet = 5},
                                  {.name = "d", .wcet = 9, .after = {0}},
                                  {.name = "e", .wcet = 4, .after = {0}}})},
      1);
  const TaskSet full = compiled(workload, kFull);
  ASSERT_EQ(full.units.size(), 2U);
  EXPECT_EQ(full.units[1].volume, 18 * kMillisecond);
  EXPECT_EQ(full.units[1].length, 14 * kMillisecond);
  Bound bound = std::get<Bound>(rta_preemptive().apply(full));
  EXPECT_EQ(bound.dags[0].response, 3 * kMillisecond);
  EXPECT_EQ(bound.dags[1].response, (18 + 2 * 3) * kMillisecond);

  bound = std::get<Bound>(rta_nonpreemptive().apply(compiled(workload, kNone)));
  EXPECT_EQ(bound.dags[0].response, (3 + 9) * kMillisecond - 1) << "blocked by the longest callback";
  EXPECT_EQ(bound.dags[1].response, (18 + 3) * kMillisecond) << "the last callback, of 4, starts at 17";
}

}  // namespace
}  // namespace redag::analysis
