// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/robot/assigned_order.hpp"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <string>

#include "redag_analysis/analyze/analyze.hpp"
#include "redag_lab/robot/input.hpp"
#include "redag_lab/robot/order.hpp"
#include "redag_lab/robot/plan.hpp"
#include "redag_lab/robot/union.hpp"
#include "redag_lab/search/audsley.hpp"
#include "redag_testing/bound_property.hpp"
#include "redag_testing/builders.hpp"
#include "redag_testing/random_workloads.hpp"

namespace redag::robot {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

Input input_from(const std::string &text) {
  Result<Input> input = parse_input(text, "cart.yaml");
  EXPECT_TRUE(input) << to_string(input.error());
  return *std::move(input);
}

// The members of each level, most urgent first: "a.d.t b.d.t | a.d.u".
std::string levels_of(const Robot &robot, int limit = 90) {
  const Result<Plan> plan = plan_of(robot, runtime::band_up_to(limit));
  if (!plan) return to_string(plan.error());
  std::string text;
  for (const PlannedLevel &level : plan->levels) {
    text += fmt::format("{}{}", text.empty() ? "" : " | ", fmt::join(level.members, " "));
  }
  return text;
}

std::string process(const std::string &name, const std::string &tasks, const std::string &policy = "rate_monotonic") {
  return fmt::format("  - {{name: {0}, match: {{name: {0}}}, workload: {{policy: {1}, dags: [{2}]}}}}\n", name, policy,
                     tasks);
}

std::string dag(const std::string &name, const std::string &task) {
  return fmt::format("{{name: {}, tasks: [{{name: t, {}}}]}}", name, task);
}

// By rate, the task with the short deadline waits for the fast one.
const std::string kShort = dag("short", "wcet: 2ms, period: 20ms, deadline: 4ms");
const std::string kFast = dag("fast", "wcet: 3ms, period: 10ms");

TEST(AssignedOrder, PutsLevelsOfProcessesWhereTheirDeadlinesHold) {
  const Input input =
      input_from("robot: cart\npolicy: audsley\ncpus: 0\nprocesses:\n" + process("a", kShort) + process("b", kFast));
  EXPECT_TRUE(input.warnings.empty()) << to_string(input.warnings);
  ASSERT_TRUE(input.robot->assigned);
  EXPECT_TRUE(input.robot->assigned->found);
  EXPECT_THAT(input.robot->assigned->tests, ElementsAre("rta_preemptive"));
  EXPECT_EQ(levels_of(*input.robot), "a.short.t | b.fast.t");
  ASSERT_TRUE(input.workload);
  EXPECT_EQ(input.workload->workload.policy, PolicyKind::Fixed);
  EXPECT_EQ(analysis::analyze(testing::compiled(input.workload->workload)).verdict, analysis::Verdict::Schedulable);
}

// Its executor would not follow another order.
TEST(AssignedOrder, KeepsTheOrderWithinAProcess) {
  const std::string robot = "robot: cart\npolicy: audsley\ncpus: 0\nprocesses:\n";
  const Input input = input_from(robot + process("a", kShort + ", " + kFast));
  EXPECT_FALSE(input.robot->assigned->found);
  EXPECT_EQ(levels_of(*input.robot), "a.fast.t | a.short.t");
  EXPECT_EQ(
      to_string(input.warnings),
      "cart.yaml:5:5: warning: no order keeps all deadlines by rta_preemptive: 'a/short.t' is at level 2 of 2, "
      "which only it could have; it responds within 5ms, and its deadline is 4ms (lower the load, or lengthen the "
      "deadline; each level has the candidate that is least late there)");
  const Input by_deadline = input_from(robot + process("a", kShort + ", " + kFast, "deadline_monotonic"));
  EXPECT_TRUE(by_deadline.robot->assigned->found);
  EXPECT_EQ(levels_of(*by_deadline.robot), "a.short.t | a.fast.t");
}

TEST(AssignedOrder, SaysHowManyCouldHaveHadTheLevel) {
  const Input input = input_from("robot: cart\npolicy: audsley\ncpus: 0\nprocesses:\n" +
                                 process("a", dag("x", "wcet: 3ms, period: 10ms, deadline: 4ms")) +
                                 process("b", dag("y", "wcet: 3ms, period: 10ms, deadline: 5ms")));
  EXPECT_THAT(to_string(input.warnings),
              HasSubstr("cart.yaml:6:5: warning: no order keeps all deadlines by rta_preemptive: 'b/y.t' is at level 2 "
                        "of 2, which 2 candidates could have; it responds within 6ms, and its deadline is 5ms"));
}

TEST(AssignedOrder, GivesThreadsAPlace) {
  const std::string text = "robot: cart\npolicy: audsley\ncpus: 0\nprocesses:\n" + process("a", kShort + ", " + kFast) +
                           process("b", dag("slow", "wcet: 1ms, period: 30ms")) +
                           "threads:\n"
                           "  - {name: driver, match: {thread: x}, level: {rate: 50ms}, wcet: 1ms, count: 2}\n"
                           "  - {name: guard, match: {thread: y}, level: above, wcet: 100us, period: 100ms}\n"
                           "  - {name: short, match: {process: a, thread: s}, level: {task: a.short.t}}\n"
                           "  - {name: logs, match: {thread: z}, level: below}\n";
  const Input input = input_from(text);
  EXPECT_TRUE(input.robot->assigned->found) << to_string(input.warnings);
  EXPECT_EQ(levels_of(*input.robot), "a.short.t | a.fast.t | b.slow.t | threads driver")
      << "threads execute 'short', so that no executor has to follow its place";
  const Result<Plan> plan = plan_of(*input.robot, runtime::band_up_to(90));
  EXPECT_THAT(plan->of_executor[0], ElementsAre(79));
  EXPECT_EQ(to_string(*plan->of_threads[0]), "FIFO 77");
  EXPECT_EQ(to_string(*plan->of_threads[1]), "FIFO 81");
  EXPECT_EQ(to_string(*plan->of_threads[2]), "FIFO 80");
  ASSERT_TRUE(input.workload);
  const std::vector<Dag> &dags = input.workload->workload.dags;
  EXPECT_GT(*dags.back().tasks[0].priority, *dags.front().tasks[0].priority) << "'guard' comes before all";
}

TEST(AssignedOrder, MergesNeighboursWhereLevelsAreFew) {
  const Input input = input_from("robot: cart\npolicy: audsley\ncpus: 0\nprocesses:\n" + process("a", kShort) +
                                 process("b", kFast) + process("c", dag("slow", "wcet: 1ms, period: 40ms")));
  EXPECT_EQ(levels_of(*input.robot), "a.short.t | b.fast.t | c.slow.t");
  EXPECT_EQ(levels_of(*input.robot, 4), "a.short.t b.fast.t | c.slow.t");
}

TEST(AssignedOrder, CountsOnEachCpuSetForItself) {
  const Input input = input_from(
      "robot: cart\npolicy: audsley\ncpu_sets: [{name: left, cpus: 0}, {name: right, cpus: 1-2}]\nprocesses:\n"
      "  - {name: a, cpus: left, match: {name: a}, workload: {dags: [" +
      kShort +
      "]}}\n"
      "  - {name: b, cpus: right, match: {name: b}, workload: {dags: [" +
      kFast +
      "]}}\n"
      "  - {name: c, cpus: left, match: {name: c}, workload: {dags: [" +
      kFast +
      "]}}\n"
      "threads:\n  - {name: x, match: {thread: x}, cpus: right, level: {rate: 5ms}, wcet: 1ms}\n");
  ASSERT_TRUE(input.robot->assigned) << to_string(input.workload.error());
  EXPECT_THAT(input.robot->assigned->tests, ElementsAre("rta_preemptive", "guan with deadlines for responses"));
  EXPECT_EQ(input.robot->assigned->of_task, (std::vector<std::vector<std::uint32_t>>{{0}, {1}, {1}}));
  EXPECT_EQ(input.robot->assigned->of_threads, std::vector<std::optional<std::uint32_t>>{0});
}

TEST(AssignedOrder, TakesDataAsLateAsTheDeadlineOfTheirSender) {
  const auto robot = [](const std::string &deadline) {
    return "robot: cart\npolicy: audsley\ncpus: 0\nprocesses:\n" +
           process("a", dag("d", "wcet: 2ms, period: 30ms, deadline: " + deadline)) +
           process("b", dag("d", "wcet: 2ms, period: 30ms") + ", " + dag("e", "wcet: 6ms, period: 40ms")) +
           "links:\n  - {from: a.d.t, to: b.d.t, transport: 1ms}\n";
  };
  const Input input = input_from(robot("5ms"));
  ASSERT_TRUE(input.workload) << to_string(input.workload.error());
  EXPECT_TRUE(input.robot->assigned->found);
  EXPECT_EQ(levels_of(*input.robot), "a.d.t | b.d.t | b.e.t");
  EXPECT_EQ(input.workload->workload.dags[1].tasks[0].jitter, 3 * kMillisecond) << "in that order";
  const Input late = input_from(robot("30ms"));
  EXPECT_FALSE(late.robot->assigned);
  EXPECT_EQ(
      to_string(late.workload.error()),
      "cart.yaml:8:5: error: data of 'a.d.t' can arrive 31ms after the release behind them, which is more than "
      "their period 30ms (policy audsley counts with the deadline of the sender: state one that is shorter by the "
      "transport than the period)");
}

TEST(AssignedOrder, RefusesWhatNoTestCovers) {
  const auto refusal = [](const std::string &rest) {
    const Input input = input_from("robot: cart\npolicy: audsley\n" + rest);
    EXPECT_FALSE(input.robot->assigned);
    EXPECT_THAT(levels_of(*input.robot), HasSubstr("no order of robot 'cart' by its bounds is known"));
    return input.workload ? "accepted" : to_string(input.workload.error());
  };
  EXPECT_THAT(refusal("cpus: 0-1\nprocesses:\n" + process("a", dag("x", "wcet: 1ms, period: 9ms, group: g") + ", " +
                                                                   dag("y", "wcet: 1ms, period: 8ms, group: g"))),
              HasSubstr("cart.yaml:2:9: error: no bound can decide the order: "));
  EXPECT_THAT(refusal("cpus: 0\nprocesses:\n" + process("a", kFast, "chain_aware")),
              HasSubstr("cart.yaml:5:5: error: process 'a' orders its jobs by chain_aware, which has no levels"));
  EXPECT_THAT(refusal("cpu_sets: [{name: s, cpus: 0}, {name: r, cpus: 1}]\nprocesses:\n"
                      "  - {name: a, cpus: s, match: {name: a}, workload: {dags: [" +
                      kFast +
                      "]}}\n"
                      "threads:\n  - {name: x, match: {thread: x}, cpus: [2], level: {rate: 5ms}, wcet: 1ms}\n"),
              HasSubstr("cart.yaml:7:5: error: threads 'x' have a rate, and run where no task does"));
}

// Rates of one process are blocks, as its executor cannot tell them apart: each unit is tested behind all its equals.
bool passes_by(const Robot &robot, const lab::OrderFreeTest &test, PolicyKind policy) {
  const United united = unite(robot, 0).value();
  const analysis::TaskSet task_set = testing::compiled(united.workload);
  const auto key = [&](const analysis::Unit &unit) {
    const Task &task = *flatten(united.workload)[unit.tasks.front()].task;
    return policy == PolicyKind::RateMonotonic ? task.period : task.deadline;
  };
  for (std::uint32_t unit = 0; unit < task_set.units.size(); ++unit) {
    lab::UnitOrder order;
    lab::UnitOrder rest;
    for (std::uint32_t other = 0; other < task_set.units.size(); ++other) {
      if (other == unit) continue;
      (key(task_set.units[other]) <= key(task_set.units[unit]) ? order : rest).push_back(other);
    }
    order.push_back(unit);
    order.insert(order.end(), rest.begin(), rest.end());
    const analysis::TaskSet ordered = testing::compiled(lab::with_order(united.workload, task_set, order));
    const std::optional<Duration> response = test.response(ordered, unit);
    if (!response || *response > std::min(task_set.units[unit].deadline, task_set.units[unit].limit)) return false;
  }
  return true;
}

TEST(AssignedOrder, IsFoundWheneverRatesOrDeadlinesPassTheTest) {
  std::uint64_t passed = 0;
  std::uint64_t found_alone = 0;
  const std::uint64_t count = testing::how_many(400);
  for (std::uint64_t seed = 1; seed <= count; ++seed) {
    Rng rng(seed);
    const bool by_rate = testing::chance(rng, 0.5);
    const PolicyKind policy = by_rate ? PolicyKind::RateMonotonic : PolicyKind::DeadlineMonotonic;
    Robot robot;
    robot.cpu_sets = {CpuSet{"", testing::chance(rng, 0.5) ? std::vector{0} : std::vector{0, 1}}};
    robot.by_bounds = true;
    for (std::uint32_t p = testing::between(rng, 2, 3); p > 0; --p) {
      testing::BoundCaseLimits limits;
      limits.min_workers = limits.max_workers = 2;
      limits.policies = {policy};
      limits.edges = testing::chance(rng, 0.3);
      limits.max_dags = limits.max_tasks = 2;
      limits.max_deadline = 1.0;
      limits.min_utilization = 0.1;
      limits.max_utilization = 0.5;
      limits.max_period = 30;
      Process each;
      each.name = fmt::format("p{}", p);
      each.workload = testing::random_bound_case(rng, limits).workload;
      each.workload->platform.preemption = PreemptionMode::Os;
      robot.processes.push_back(std::move(each));
    }
    const Result<United> united = unite(robot, 0);
    ASSERT_TRUE(united) << to_string(united.error());
    const lab::TestChoice choice = lab::order_free_test(united->workload, analysis::platform_of(united->workload));
    ASSERT_TRUE(choice.test) << choice.reason;
    const Result<OrderSearch> search = search_order(robot);
    ASSERT_TRUE(search) << to_string(search.error());
    const bool passes = passes_by(robot, *choice.test, policy);
    ASSERT_TRUE(search->order.found || !passes) << "seed " << seed;
    ASSERT_EQ(search->order.found, search->warnings.empty());
    passed += passes ? 1 : 0;
    found_alone += search->order.found && !passes ? 1U : 0U;
    // Each executor can follow: a level that is more urgent in the process has no less urgent place.
    for (std::size_t p = 0; p < robot.processes.size(); ++p) {
      const auto own = own_levels(robot, p);
      for (std::size_t a = 0; a < own.size(); ++a) {
        for (std::size_t b = 0; b < own.size(); ++b) {
          ASSERT_EQ(*own[a] < *own[b], search->order.of_task[p][a] < search->order.of_task[p][b]) << "seed " << seed;
        }
      }
    }
  }
  EXPECT_GT(passed, count / 10);
  EXPECT_GT(found_alone, 0U);
}

}  // namespace
}  // namespace redag::robot
