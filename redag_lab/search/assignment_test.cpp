// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/search/assignment.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <numeric>

#include "redag/model/workload_yaml.hpp"
#include "redag_analysis/analyze/analyze.hpp"
#include "redag_testing/bound_property.hpp"
#include "redag_testing/builders.hpp"
#include "redag_testing/random_workloads.hpp"

namespace redag::lab {
namespace {

using testing::BoundCase;
using testing::BoundCaseLimits;
using testing::independent;
using testing::tick_dag;

Assignment assigned(const Workload &workload, const AssignmentOptions &options = {}) {
  return assign(workload, analysis::platform_of(workload), options).value();
}

TEST(Assignment, ShortDeadlinesGoFirst) {
  // By rate, b waits for a and responds after 5. By deadline, it responds after 2.
  const Assignment result = assigned(independent({{3, 10}, {2, 20, 4}}));
  EXPECT_FALSE(result.present.score.schedulable);
  EXPECT_EQ(result.present.score.extremes.worst_lateness, 1);
  EXPECT_TRUE(result.best.score.schedulable);
  EXPECT_EQ(result.best.order, "deadline_monotonic");
  EXPECT_EQ(result.best.score.extremes.worst_lateness, -2);
  EXPECT_EQ(result.best.workload.policy, PolicyKind::DeadlineMonotonic);
}

TEST(Assignment, AudsleyBeatsDeadlinesLongerThanPeriods) {
  // From J. Lehoczky, RTSS 1990: with D > T, neither rates nor deadlines decide. With (52, 100, D = 110) above (52,
  // 140, D = 154), the second responds after 156. In the other order the responses are 108 and 52.
  Workload workload = independent({{52, 100, 110}, {52, 140, 154}});
  for (Dag &dag : workload.dags) {
    dag.tasks[0].overrun = Overrun::Queue;
    dag.tasks[0].queue_depth = 2;
  }
  const Assignment result = assigned(workload);
  EXPECT_FALSE(result.present.score.schedulable);
  EXPECT_TRUE(result.audsley_optimal);
  EXPECT_TRUE(result.audsley_found);
  EXPECT_EQ(result.best.order, "audsley");
  EXPECT_TRUE(result.best.score.schedulable);
  EXPECT_EQ(result.best.units, (UnitOrder{1, 0}));
  EXPECT_EQ(result.best.score.extremes.worst_lateness, -2);
  EXPECT_EQ(result.best.workload.policy, PolicyKind::Fixed);
  EXPECT_GT(result.best.workload.dags[1].tasks[0].priority, result.best.workload.dags[0].tasks[0].priority);
}

TEST(Assignment, LeavesAloneWhatNothingImproves) {
  const Workload workload = independent({{1, 4}, {1, 8}});
  for (const Objective objective : {Objective::Lateness, Objective::Slack}) {
    AssignmentOptions options;
    options.objective = objective;
    const Assignment result = assigned(workload, options);
    EXPECT_EQ(result.best.order, "present");
    EXPECT_EQ(result.best.workload, workload);
  }
}

TEST(Assignment, ObjectivesDiffer) {
  // With (2, 6) above (2, 20): R = 2 and 4, lateness -4 and -16, slack 4/6 and 16/20. In the other order R = 4 and 2,
  // and the largest lateness is -2.
  const BoundScore high{true, 0, {-4, 0.6, true}, 10};
  const BoundScore low{true, 0, {-2, 0.9, true}, 9};
  EXPECT_TRUE(is_better(high, low, Objective::Lateness));
  EXPECT_TRUE(is_better(low, high, Objective::Slack));
  EXPECT_TRUE(
      is_better(BoundScore{true, 0, {5, 0, true}, 0}, BoundScore{false, 0, {-5, 1, true}, 0}, Objective::Lateness));
  EXPECT_TRUE(
      is_better(BoundScore{false, 1, {5, 0, true}, 0}, BoundScore{false, 2, {-5, 1, true}, 0}, Objective::Lateness));
  BoundScore smaller = high;
  smaller.total = 9;
  EXPECT_TRUE(is_better(smaller, high, Objective::Lateness));
  EXPECT_FALSE(improves(smaller, high, Objective::Lateness));
}

TEST(Assignment, ABoundOfActiveJobsIsolatesADag) {
  // On 3 workers, without preemption, "wide" can fill all workers and block "quick" for 40. With at most 2 active jobs
  // of "wide", "quick" always finds a worker.
  const std::vector<testing::TestTask> wide = {
      {"source", 400, 40}, {"a", 0, 40, {0}}, {"b", 0, 40, {0}}, {"c", 0, 40, {0}}, {"d", 0, 40, {0}}};
  const Workload workload = testing::make_workload({tick_dag("quick", {{"t", 20, 2}}), tick_dag("wide", wide)}, 3);
  const Assignment result = assigned(workload);
  EXPECT_FALSE(result.present.score.schedulable);
  EXPECT_TRUE(result.best.score.schedulable);
  EXPECT_EQ(result.best.caps[0], 0U);
  EXPECT_EQ(result.best.caps[1], 2U);
  EXPECT_TRUE(result.exhaustive);
  EXPECT_EQ(result.trials.size(), 4U);  // none, 1, 2, 3 for "wide"
  AssignmentOptions keep;
  keep.caps = false;
  EXPECT_EQ(assigned(workload, keep).best.caps, (Caps{0, 0}));
}

TEST(Assignment, LocalSearchIsDeterministicAndNoBetterThanAll) {
  int compared = 0;
  for (int i = 0; i < 40; ++i) {
    Rng rng(mix(static_cast<std::uint64_t>(i) + 5));
    BoundCaseLimits limits;
    limits.min_workers = limits.max_workers = 3;
    limits.edges = limits.caps = true;
    limits.max_dags = 3;
    limits.max_utilization = 0.7;
    limits.preemption = i % 2 == 0 ? sched::Preemption::Full : sched::Preemption::None;
    const BoundCase bound_case = testing::random_bound_case(rng, limits);
    AssignmentOptions all;
    all.priorities = false;
    AssignmentOptions local = all;
    local.exhaustive = 0;
    const auto a = assign(bound_case.workload, bound_case.platform, all);
    const auto b = assign(bound_case.workload, bound_case.platform, local);
    const auto c = assign(bound_case.workload, bound_case.platform, local);
    ASSERT_TRUE(a && b && c);
    EXPECT_TRUE(a->exhaustive);
    EXPECT_FALSE(b->exhaustive);
    EXPECT_EQ(b->best.workload, c->best.workload);
    EXPECT_FALSE(is_better(b->best.score, a->best.score, Objective::Lateness));
    EXPECT_FALSE(is_better(a->present.score, b->best.score, Objective::Lateness));
    compared += improves(a->best.score, a->present.score, Objective::Lateness) ? 1 : 0;
  }
  EXPECT_GT(compared, 0);
}

TEST(Assignment, StopsWithTheBestSoFar) {
  AssignmentOptions options;
  int asked = 0;
  options.stop = [&] { return ++asked > 1; };
  const Workload workload = independent({{3, 10}, {2, 20, 4}});
  const Assignment result = assigned(workload, options);
  EXPECT_TRUE(result.stopped);
  EXPECT_EQ(result.best.workload, workload);
}

TEST(Assignment, OfEdfChangesNoOrderThatWorks) {
  const Workload workload = independent({{3, 10}, {2, 20, 4}}, 1, PolicyKind::Edf);
  const Assignment result = assigned(workload);
  EXPECT_TRUE(result.present.score.schedulable);
  EXPECT_EQ(result.best.workload, workload);
}

// Every unit's response under the order-free test fits its deadline, and the largest lateness.
struct UnderTest {
  bool all_fit = true;
  Duration worst = std::numeric_limits<Duration>::min();
};
UnderTest under(const OrderFreeTest &test, const BoundCase &bound_case, const analysis::TaskSet &task_set,
                const UnitOrder &order) {
  UnderTest result;
  const analysis::TaskSet ordered =
      analysis::compile(with_order(bound_case.workload, task_set, order), bound_case.platform).value();
  for (const std::uint32_t unit : order) {
    const Duration due = std::min(task_set.units[unit].deadline, task_set.units[unit].limit);
    const std::optional<Duration> response = test.response(ordered, unit);
    result.all_fit = result.all_fit && response && *response <= due;
    result.worst = std::max(result.worst, response ? *response - due : kMaxDuration);
  }
  return result;
}

// Checks tests that are marked optimal for Audsley's assignment: no order of all n! is better. A found order must also
// be schedulable by analyze().
void expect_optimal(BoundCaseLimits limits) {
  limits.max_dags = 4;
  limits.min_utilization = limits.max_workers > 1 ? 0.2 : 0.6;
  limits.policies = {PolicyKind::RateMonotonic};
  const auto cases = static_cast<int>(testing::how_many(150));
  int tried = 0;
  int found_some = 0;
  for (int i = 0; i < cases; ++i) {
    Rng rng(mix(static_cast<std::uint64_t>(i) + 31));
    const BoundCase bound_case = testing::random_bound_case(rng, limits);
    const analysis::TaskSet task_set = analysis::compile(bound_case.workload, bound_case.platform).value();
    const TestChoice choice = order_free_test(bound_case.workload, bound_case.platform);
    if (!choice.test || task_set.units.size() > 5) continue;
    ASSERT_TRUE(choice.test->optimal);
    SCOPED_TRACE(describe(bound_case));
    const auto lateness = [](Duration response, Duration due) { return static_cast<double>(response - due); };
    const auto found = audsley(bound_case.workload, bound_case.platform, *choice.test, all_orders(task_set), lateness);
    ASSERT_TRUE(found);
    const UnderTest best = under(*choice.test, bound_case, task_set, found->order);
    ASSERT_EQ(best.all_fit, !found->failure);
    ++tried;
    UnitOrder order(task_set.units.size());
    std::iota(order.begin(), order.end(), 0);
    do {
      const UnderTest other = under(*choice.test, bound_case, task_set, order);
      ASSERT_LE(best.worst, other.worst);
      ASSERT_TRUE(!found->failure || !other.all_fit);
    } while (std::next_permutation(order.begin(), order.end()));
    if (found->failure) continue;
    ++found_some;
    const analysis::TaskSet ordered =
        analysis::compile(with_order(bound_case.workload, task_set, found->order), bound_case.platform).value();
    ASSERT_EQ(analysis::analyze(ordered).verdict, analysis::Verdict::Schedulable);
  }
  EXPECT_GT(tried, cases / 4);
  EXPECT_GT(found_some, cases / 20);
  EXPECT_LT(found_some, tried);
}

// True if the order has the units of each chain in the chain's order, and begins with `first`.
bool is_among(const Orders &orders, const UnitOrder &order) {
  const auto place = [&](std::uint32_t unit) { return std::find(order.begin(), order.end(), unit) - order.begin(); };
  for (std::size_t i = 0; i < orders.first.size(); ++i) {
    if (order[i] != orders.first[i]) return false;
  }
  return std::all_of(orders.chains.begin(), orders.chains.end(), [&](const std::vector<UnitBlock> &chain) {
    return std::is_sorted(chain.begin(), chain.end(),
                          [&](const UnitBlock &a, const UnitBlock &b) { return place(a[0]) < place(b[0]); });
  });
}

// No order that keeps the chains is better than the one found.
TEST(AudsleyProperty, ChainsKeepTheirOrder) {
  int tried = 0;
  int found_some = 0;
  int free_only = 0;  // schedulable in an order that the chains exclude
  for (int i = 0; i < static_cast<int>(testing::how_many(300)); ++i) {
    Rng rng(mix(static_cast<std::uint64_t>(i) + 77));
    BoundCaseLimits limits;
    limits.max_dags = 5;
    limits.edges = true;
    limits.max_deadline = 1.6;
    limits.min_utilization = 0.4;
    limits.min_workers = limits.max_workers = testing::between(rng, 1, 2);
    limits.policies = {PolicyKind::RateMonotonic};
    const BoundCase bound_case = testing::random_bound_case(rng, limits);
    const analysis::TaskSet task_set = analysis::compile(bound_case.workload, bound_case.platform).value();
    const TestChoice choice = order_free_test(bound_case.workload, bound_case.platform);
    const auto count = static_cast<std::uint32_t>(task_set.units.size());
    if (!choice.test || count < 3 || count > 5) continue;
    SCOPED_TRACE(describe(bound_case));
    Orders orders;
    orders.chains.resize(2);
    for (std::uint32_t unit = 0; unit < count; ++unit) {
      if (unit == 2 && testing::chance(rng, 0.3)) {
        orders.first.push_back(unit);
      } else {
        orders.chains[testing::between(rng, 0, 1)].push_back({unit});
      }
    }
    const auto lateness = [](Duration response, Duration due) { return static_cast<double>(response - due); };
    const auto found = audsley(bound_case.workload, bound_case.platform, *choice.test, orders, lateness);
    ASSERT_TRUE(found);
    ASSERT_TRUE(is_among(orders, found->order));
    const UnderTest best = under(*choice.test, bound_case, task_set, found->order);
    ASSERT_EQ(best.all_fit, !found->failure);
    ++tried;
    found_some += best.all_fit ? 1 : 0;
    UnitOrder order(count);
    std::iota(order.begin(), order.end(), 0);
    bool any_fits = false;
    do {
      const UnderTest other = under(*choice.test, bound_case, task_set, order);
      any_fits = any_fits || other.all_fit;
      if (!is_among(orders, order)) continue;
      ASSERT_LE(best.worst, other.worst);
      ASSERT_TRUE(best.all_fit || !other.all_fit);
    } while (std::next_permutation(order.begin(), order.end()));
    free_only += any_fits && !best.all_fit ? 1 : 0;
  }
  EXPECT_GT(tried, 50);
  EXPECT_GT(found_some, 10);
  EXPECT_GT(free_only, 0);
}

// A block is as late as its worst unit, and its units stay neighbours.
TEST(Audsley, SaysWhichUnitHasNoPlace) {
  const Workload workload = independent({{2, 10, 4}, {3, 10, 8}, {4, 20, 12}});
  const analysis::AnalysisPlatform platform = analysis::platform_of(workload);
  const TestChoice choice = order_free_test(workload, platform);
  ASSERT_TRUE(choice.test);
  const auto lateness = [](Duration response, Duration due) { return static_cast<double>(response - due); };
  const auto free = audsley(workload, platform, *choice.test, {{}, {{{0}}, {{1}}, {{2}}}}, lateness);
  EXPECT_EQ(free->order, (UnitOrder{0, 1, 2}));
  EXPECT_FALSE(free->failure);
  const auto chained = audsley(workload, platform, *choice.test, {{}, {{{1}, {0}}, {{2}}}}, lateness);
  EXPECT_EQ(chained->order, (UnitOrder{1, 0, 2}));
  ASSERT_TRUE(chained->failure);
  EXPECT_EQ(chained->failure->unit, 0U);
  EXPECT_EQ(chained->failure->response, 5);
  EXPECT_EQ(chained->failure->due, 4);
  EXPECT_EQ(chained->failure->rivals, 1U) << "the chain alone";
  const auto blocks = audsley(workload, platform, *choice.test, {{}, {{{0, 2}}, {{1}}}}, lateness);
  EXPECT_EQ(blocks->order, (UnitOrder{0, 2, 1})) << "9 of 8 for the last is less late than 9 of 4";
  EXPECT_EQ(blocks->failure->unit, 1U);
  const auto first = audsley(workload, platform, *choice.test, {{2, 0}, {{{1}}}}, lateness);
  EXPECT_EQ(first->order, (UnitOrder{2, 0, 1}));
  EXPECT_EQ(first->failure->unit, 1U) << "the least urgent one";
}

TEST(AudsleyProperty, OneWorkerWithJitterAndGroups) {
  BoundCaseLimits limits;
  limits.jitter = limits.groups = limits.queues = true;
  limits.max_deadline = 1.6;
  expect_optimal(limits);
}

TEST(AudsleyProperty, OneWorkerRunToCompletion) {
  BoundCaseLimits limits;
  limits.preemption = sched::Preemption::None;
  limits.jitter = limits.queues = true;
  limits.max_deadline = 1.6;
  expect_optimal(limits);
}

TEST(AudsleyProperty, OneWorkerCooperative) {
  BoundCaseLimits limits;
  limits.preemption = sched::Preemption::Cooperative;
  expect_optimal(limits);
}

TEST(AudsleyProperty, OneWorkerDags) {
  BoundCaseLimits limits;
  limits.edges = limits.groups = true;
  expect_optimal(limits);
}

TEST(AudsleyProperty, SeveralWorkers) {
  BoundCaseLimits limits;
  limits.min_workers = 2;
  limits.max_workers = 3;
  limits.jitter = true;
  expect_optimal(limits);
}

TEST(AudsleyProperty, SeveralWorkersDags) {
  BoundCaseLimits limits;
  limits.min_workers = 2;
  limits.max_workers = 3;
  limits.edges = limits.caps = true;
  limits.min_deadline = 0.8;
  limits.max_utilization = 0.8;
  expect_optimal(limits);
}

TEST(AssignmentProperty, NeverWorseAndWhatIsWrittenMeansTheSame) {
  const auto cases = static_cast<int>(testing::how_many(150));
  int better = 0;
  for (int i = 0; i < cases; ++i) {
    Rng rng(mix(static_cast<std::uint64_t>(i) + 901));
    BoundCaseLimits limits;
    limits.max_workers = 3;
    limits.edges = i % 2 == 0;
    limits.caps = true;
    limits.max_dags = 4;
    limits.preemption = i % 3 == 0 ? sched::Preemption::None : sched::Preemption::Full;
    limits.policies = {PolicyKind::RateMonotonic, PolicyKind::Fixed, PolicyKind::ChainAware, PolicyKind::Edf};
    const BoundCase bound_case = testing::random_bound_case(rng, limits);
    SCOPED_TRACE(describe(bound_case));
    for (const Objective objective : {Objective::Lateness, Objective::Slack}) {
      AssignmentOptions options;
      options.objective = objective;
      const auto result = assign(bound_case.workload, bound_case.platform, options);
      ASSERT_TRUE(result);
      ASSERT_FALSE(is_better(result->present.score, result->best.score, objective) &&
                   improves(result->present.score, result->best.score, objective));
      better += improves(result->best.score, result->present.score, objective) ? 1 : 0;
      // Written to YAML and read again, the workload has the same score. Only order and caps have changed.
      const auto read = parse_workload(to_yaml(result->best.workload), "w.yaml");
      ASSERT_TRUE(read) << to_string(read.error());
      ASSERT_EQ(score_of(analysis::compile(read->workload, bound_case.platform).value()), result->best.score);
      Workload undone = result->best.workload;
      undone.policy = bound_case.workload.policy;
      for (std::size_t d = 0; d < undone.dags.size(); ++d) {
        undone.dags[d].max_active = bound_case.workload.dags[d].max_active;
        for (std::size_t t = 0; t < undone.dags[d].tasks.size(); ++t) {
          undone.dags[d].tasks[t].priority = bound_case.workload.dags[d].tasks[t].priority;
        }
      }
      ASSERT_EQ(undone, bound_case.workload);
    }
  }
  EXPECT_GT(better, 0);
}

}  // namespace
}  // namespace redag::lab
