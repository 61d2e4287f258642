// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/core/effort.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <map>

#include "redag_analysis/analyze/analyze.hpp"
#include "redag_analysis/many_workers/global_dag.hpp"
#include "redag_analysis/one_worker/response_time.hpp"
#include "tests/testing/bound_property.hpp"
#include "tests/testing/builders.hpp"

namespace redag::analysis {
namespace {

using testing::BoundCase;
using testing::BoundCaseLimits;

// Independent tasks of three periods that use half of the workers.
TaskSet many_tasks(std::size_t count, std::uint32_t workers, Ties ties = Ties::Share,
                   PolicyKind policy = PolicyKind::RateMonotonic) {
  std::vector<testing::Load> loads;
  for (std::size_t i = 0; i < count; ++i) {
    const Duration period = Duration{10} * static_cast<Duration>(i % 3 + 1) * kMillisecond;
    loads.push_back({period * workers / 2 / static_cast<Duration>(count), period});
  }
  Workload workload = testing::independent(loads, workers, policy);
  workload.ties = ties;
  return testing::compiled(workload);
}

AnalyzeOptions itemising() {
  AnalyzeOptions options;
  options.itemise = true;
  return options;
}

std::size_t terms_in(const Report &report) {
  std::size_t count = 0;
  for (const MethodReport &method : report.methods) {
    if (method.bound() == nullptr) continue;
    for (const ResponseBound &bound : method.bound()->tasks) count += bound.terms.size();
    for (const ResponseBound &bound : method.bound()->dags) count += bound.terms.size();
  }
  return count;
}

const MethodReport &report_of(const Report &report, std::string_view name) {
  return *std::find_if(report.methods.begin(), report.methods.end(),
                       [&](const MethodReport &method) { return method.method->name == name; });
}

std::uint64_t steps_of(const Method &method, const TaskSet &task_set) {
  Effort::Limits limits;
  limits.itemised.which = Itemised::Which::None;
  const Effort effort(limits);
  EXPECT_TRUE(std::holds_alternative<Bound>(method.apply(task_set)));
  return effort.steps();
}

TEST(Effort, AMethodGivesUpAtItsLimitAndTheOthersAnswer) {
  const TaskSet task_set = many_tasks(1500, 2, Ties::Share, PolicyKind::Edf);
  AnalyzeOptions options;
  options.effort = 1'000'000;
  const Report report = analyze(task_set, options);
  const MethodReport &dear = report_of(report, "edf_global_response");
  EXPECT_TRUE(dear.gave_up());
  EXPECT_EQ(std::get<NotApplicable>(dear.outcome).reason, "more than 1 million steps");
  EXPECT_EQ(dear.verdict, Verdict::NotShown);
  EXPECT_TRUE(report_of(report, "edf_global_density").bound()->accepts.value());
  EXPECT_FALSE(report_of(report, "dag_bounded").gave_up()) << "does not apply";
  EXPECT_EQ(report.verdict, Verdict::Schedulable);
  EXPECT_FALSE(report_of(analyze(many_tasks(1500, 2)), "dag_bounded").gave_up()) << "the usual effort is enough";
}

TEST(Effort, TheCallerEndsAMethodForAReason) {
  const TaskSet task_set = many_tasks(1500, 2, Ties::Fixed);
  std::map<std::string, int> asked;
  AnalyzeOptions options;
  options.stop = [&](const AnalysisProgress &progress) {
    ++asked[std::string(progress.method.name)];
    EXPECT_GT(progress.at.steps, 0U);
    EXPECT_GE(progress.at.done, 0.0);
    EXPECT_LT(progress.at.done, 1.0);
    EXPECT_LT(progress.index, progress.count);
    return std::string(progress.method.name == "guan" ? "enough" : "");
  };
  const Report report = analyze(task_set, options);
  EXPECT_EQ(std::get<NotApplicable>(report_of(report, "guan").outcome).reason, "enough");
  EXPECT_EQ(asked["guan"], 1);
  EXPECT_GT(asked["dag_bounded"], 1);
  EXPECT_FALSE(report_of(report, "dag_bounded").gave_up());
}

TEST(Effort, AScopeOfTheCallerEndsWhatIsInside) {
  const TaskSet task_set = many_tasks(1500, 2);
  Effort::Limits limits;
  limits.steps = 1'000'000;
  const Effort effort(limits);
  try {
    (void)analyze(task_set);
    FAIL() << "nothing was thrown";
  } catch (const Effort::GaveUp &gave_up) {
    EXPECT_EQ(gave_up.scope, &effort);
  }
}

// The size of an answer grows with the tasks, not with their pairs.
TEST(Effort, TermsAreMadeOnDemandAlone) {
  for (const std::uint32_t workers : {1U, 2U}) {
    const TaskSet task_set = many_tasks(150, workers);
    EXPECT_EQ(terms_in(analyze(task_set)), 0U);
    EXPECT_GT(terms_in(analyze(task_set, itemising())), std::size_t{150} * 150 / 2);
  }
}

TEST(Effort, ABoundItemisedAloneIsTheSameAsAmongAll) {
  std::size_t compared = 0;
  BoundCaseLimits limits;
  limits.max_workers = 3;
  limits.edges = limits.jitter = limits.caps = true;
  Rng rng(5);
  for (int i = 0; i < 300; ++i) {
    const BoundCase one = random_bound_case(rng, limits);
    const Result<TaskSet> task_set = compile(one.workload, one.platform);
    if (!task_set || !task_set->not_analysable.empty()) continue;
    const Report all = analyze(*task_set, itemising());
    const Report none = analyze(*task_set);
    for (std::size_t t = 0; t < all.tasks.size(); ++t) {
      EXPECT_EQ(none.tasks[t].response, all.tasks[t].response);
      if (all.tasks[t].method == nullptr) continue;
      EXPECT_EQ(itemised(*task_set, none.tasks[t], TaskId(t)).terms, all.tasks[t].bound.terms);
      ++compared;
    }
    for (std::size_t d = 0; d < all.dags.size(); ++d) {
      if (all.dags[d].method == nullptr) continue;
      EXPECT_EQ(itemised(*task_set, none.dags[d], DagId(d)).terms, all.dags[d].bound.terms);
      ++compared;
    }
  }
  EXPECT_GT(compared, 300U);
}

// On one worker the tasks of one period are evaluated together. With few periods the steps are linear in the tasks.
TEST(Effort, OneWorkerTakesLinearStepsInTasksOfFewPeriods) {
  const std::uint64_t few = steps_of(rta_preemptive(), many_tasks(300, 1));
  const std::uint64_t many = steps_of(rta_preemptive(), many_tasks(1500, 1));
  EXPECT_GT(few, 300U);
  EXPECT_LE(many, 20 * few);
}

// On several workers each task looks at all more urgent ones, in each of a few evaluations.
TEST(Effort, SeveralWorkersTakeQuadraticStepsAtMost) {
  const std::uint64_t few = steps_of(dag_bounded(), many_tasks(300, 2));
  const std::uint64_t many = steps_of(dag_bounded(), many_tasks(1500, 2));
  EXPECT_LE(many, 200 * few);
}

}  // namespace
}  // namespace redag::analysis
