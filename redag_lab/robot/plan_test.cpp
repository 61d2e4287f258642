// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/robot/plan.hpp"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <string>

#include "redag/sched/policy.hpp"
#include "redag_lab/robot/changes.hpp"
#include "redag_lab/robot/robot_yaml.hpp"
#include "redag_testing/random_workloads.hpp"

namespace redag::robot {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

Robot robot_from(const std::string &text) {
  const Result<yaml::Node> root = yaml::parse(text, "cart.yaml");
  const Result<LoadedRobot> loaded = read_robot(*root, "cart.yaml");
  EXPECT_TRUE(loaded) << to_string(loaded.error());
  return loaded ? loaded->robot : Robot{};
}

constexpr const char *kCart = R"(robot: cart
cpus: 0-1
processes:
  - name: base
    match: {name: base_node}
    workload:
      dags:
        - name: d
          tasks: [{name: fast, wcet: 1ms, period: 5ms}, {name: slow, wcet: 1ms, period: 20ms}]
  - name: arm
    match: {command: "*/arm *"}
    workload:
      dags:
        - name: d
          tasks: [{name: mid, wcet: 1ms, period: 10ms}, {name: loop, wcet: 1ms, period: 7ms}]
threads:
  - {name: loop, match: {process: arm, thread: "loop*"}, level: {task: arm.d.loop}}
  - {name: dds, match: {thread: "dds.*"}, level: {rate: 20ms}, wcet: 1ms}
  - {name: guard, match: {name: guard}, level: above, wcet: 1us, period: 1s}
  - {name: logs, match: {name: logs}, level: below}
  - {name: torch, match: {thread: "pt_*"}, level: {nice: 7}, cpus: 1}
irqs:
  - {name: net, match: "eth*", cpus: 1}
)";

TEST(RobotPlan, IsOneOrderOverAllProcesses) {
  const Result<Plan> plan = plan_of(robot_from(kCart), runtime::band_up_to(90));
  ASSERT_TRUE(plan) << to_string(plan.error());
  ASSERT_EQ(plan->levels.size(), 4u);
  EXPECT_EQ(plan->levels[0].priority, 80);
  EXPECT_THAT(plan->levels[0].members, ElementsAre("base.d.fast"));
  EXPECT_THAT(plan->levels[1].members, ElementsAre("arm.d.loop"));
  EXPECT_THAT(plan->levels[2].members, ElementsAre("arm.d.mid"));
  EXPECT_THAT(plan->levels[3].members, ElementsAre("base.d.slow", "threads dds"));
  EXPECT_EQ(plan->levels[3].first, 20 * kMillisecond);
  EXPECT_THAT(plan->of_executor[0], ElementsAre(80, 77));
  EXPECT_THAT(plan->of_executor[1], ElementsAre(78)) << "without the task that threads execute";
  EXPECT_EQ(to_string(*plan->of_threads[0]), "FIFO 79");
  EXPECT_EQ(to_string(*plan->of_threads[1]), "FIFO 77");
  EXPECT_EQ(to_string(*plan->of_threads[2]), "FIFO 81");
  EXPECT_EQ(to_string(*plan->of_threads[3]), "FIFO 1");
  EXPECT_EQ(to_string(*plan->of_threads[4]), "nice 7");
  EXPECT_TRUE(plan->of_threads[0]->resets_on_fork);
}

TEST(RobotPlan, MergesNeighboursWithinASmallBand) {
  const Result<Plan> plan = plan_of(robot_from(kCart), runtime::band_up_to(5));
  ASSERT_TRUE(plan) << to_string(plan.error());
  EXPECT_EQ(plan->band.timer, 5);
  EXPECT_EQ(plan->band.top_job, 3) << "one is left for the threads above";
  EXPECT_TRUE(plan->order.is_merged());
  ASSERT_EQ(plan->levels.size(), 2u);
  EXPECT_EQ(plan->levels[0].first, 5 * kMillisecond);
  EXPECT_EQ(plan->levels[0].last, 7 * kMillisecond);
  EXPECT_THAT(plan->of_executor[0], ElementsAre(3, 2));
  EXPECT_EQ(to_string(*plan->of_threads[2]), "FIFO 4");
}

TEST(RobotPlan, RefusesABandWithoutRoom) {
  const Result<Plan> plan = plan_of(robot_from(kCart), runtime::band_up_to(2));
  ASSERT_FALSE(plan);
  EXPECT_THAT(to_string(plan.error()), HasSubstr("too few priorities"));
}

TEST(RobotPlan, RefusesAPriorityAmongThoseOfTasks) {
  Robot robot = robot_from(kCart);
  robot.threads[3].level = Level{.kind = Level::Kind::Fifo, .value = 78};
  const Result<Plan> plan = plan_of(robot, runtime::band_up_to(90));
  ASSERT_FALSE(plan);
  EXPECT_THAT(to_string(plan.error()),
              HasSubstr("cart.yaml:20:5: error: priority 78 of threads 'logs' is among those of tasks, 77 to 80"));
  robot.threads[3].level->value = 76;
  EXPECT_TRUE(plan_of(robot, runtime::band_up_to(90)));
}

// The executor of a process, which knows only its own tasks, gives each the priority that the plan has for it.
RC_GTEST_PROP(RobotPlan, ExecutorsWithTheirLevelsKeepTheOneOrder, ()) {
  Rng rng(*rc::gen::arbitrary<std::uint64_t>());
  Robot robot;
  robot.cpu_sets = {CpuSet{"", {0}}};
  for (std::uint32_t p = testing::between(rng, 1, 3); p > 0; --p) {
    Process process;
    process.name = std::string(1, static_cast<char>('a' + p));
    process.workload = testing::random_workload(rng);
    robot.processes.push_back(std::move(process));
  }
  const Result<Plan> plan = plan_of(robot, runtime::band_up_to(static_cast<int>(testing::between(rng, 4, 30))));
  RC_ASSERT(plan.has_value());
  for (std::size_t p = 0; p < robot.processes.size(); ++p) {
    const Result<runtime::PriorityBand> band =
        runtime::with_levels(runtime::band_up_to(90), levels_text(plan->of_executor[p]));
    RC_ASSERT(band.has_value());
    for (const Ties ties : {Ties::Share, Ties::Fixed}) {
      const auto own = sched::assign_priorities(robot.processes[p].workload->dags, robot.policy, ties, band->levels());
      for (std::size_t t = 0; t < own.size(); ++t) {
        RC_ASSERT(band->of_level(own[t].level) == plan->band.of_level(plan->order.of_task[p][t]));
      }
    }
  }
}

TEST(RobotLevels, ReadsPrioritiesOfLevels) {
  const Result<runtime::PriorityBand> band = runtime::with_levels(runtime::band_up_to(90), "80,77,77");
  ASSERT_TRUE(band);
  EXPECT_EQ(band->levels(), 3u);
  EXPECT_EQ(band->of_level(0), 80);
  EXPECT_EQ(band->of_level(2), 77);
  EXPECT_EQ(band->of_level(3), 1) << "demoted jobs";
  EXPECT_EQ(band->timer, 90);
  for (const char *bad : {"80,", ",80", "77,80", "80,1", "x", "80 77", "-3", "80,,77"}) {
    EXPECT_FALSE(runtime::with_levels(runtime::band_up_to(90), bad)) << bad;
  }
  const auto refused = runtime::with_levels(runtime::band_up_to(50), "80");
  ASSERT_FALSE(refused);
  EXPECT_THAT(to_string(refused.error()), HasSubstr("asks for priority 80, and this process can have at most 49"));
}

LiveThread thread(std::int64_t tid, std::string name, Scheduling scheduling = {}, std::vector<int> cpus = {0, 1}) {
  return LiveThread{ThreadId{tid / 10, tid, 1}, std::move(name), ThreadState{scheduling, std::move(cpus)}};
}

Changes changes_with(const Robot &robot, const std::vector<LiveProcess> &processes,
                     const std::vector<LiveInterrupt> &interrupts = {}) {
  const Result<Plan> plan = plan_of(robot, runtime::band_up_to(90));
  EXPECT_TRUE(plan);
  return changes_of(robot, *plan, Snapshot{processes, interrupts, {}});
}

TEST(RobotChanges, FindsThreadsByProcessAndName) {
  const Changes changes =
      changes_with(robot_from(kCart),
                   {{1, "arm", "/opt/arm --x", "/", {thread(10, "arm"), thread(11, "loop0"), thread(12, "dds.udp")}},
                    {2, "other", "/opt/other", "/", {thread(20, "loop0"), thread(21, "pt_1", {}, {0, 1})}},
                    {3, "base_node", "base_node", "/", {thread(30, "base_node", {}, {0, 1, 2, 3})}}});
  ASSERT_EQ(changes.threads.size(), 4u);
  EXPECT_EQ(changes.threads[0].name, "loop0");
  EXPECT_EQ(to_string(changes.threads[0].after.scheduling), "FIFO 79");
  EXPECT_EQ(changes.threads[0].entry, "threads loop");
  EXPECT_EQ(changes.threads[1].entry, "threads dds");
  EXPECT_EQ(changes.threads[2].after.cpus, (std::vector<int>{1}));
  EXPECT_EQ(changes.threads[3].entry, "process base");
  EXPECT_EQ(changes.threads[3].after.cpus, (std::vector<int>{0, 1})) << "back to the processors of its set";
  EXPECT_EQ(to_string(changes.threads[3].after.scheduling), "nice 0");
  EXPECT_EQ(changes.matched, 5u);
  EXPECT_THAT(changes.running, ElementsAre(std::vector<std::int64_t>{3}, std::vector<std::int64_t>{1}));
}

TEST(RobotChanges, AreEmptyWhereAllIsAsPlanned) {
  const Scheduling planned{Scheduling::Class::Fifo, 79, 0, false};
  const Changes changes = changes_with(
      robot_from(kCart),
      {{1, "arm", "/opt/arm --x", "/", {thread(11, "loop0", planned, {1}), thread(12, "worker", {}, {0})}}},
      {{24, "IR-PCI-MSI 1-edge eth0-rx, eth1", {1}}});
  EXPECT_TRUE(changes.is_empty());
  EXPECT_EQ(changes.matched, 2u);
}

TEST(RobotChanges, MovesInterruptsByNameOrNumber) {
  Robot robot = robot_from(kCart);
  const std::vector<LiveInterrupt> there = {{24, "IR-PCI-MSI 1-edge eth0-rx, eth1", {0}},
                                            {25, "GIC-0 27 arch_timer", {0}}};
  Changes changes = changes_with(robot, {}, there);
  ASSERT_EQ(changes.interrupts.size(), 1u);
  EXPECT_EQ(changes.interrupts[0].number, 24);
  EXPECT_EQ(changes.interrupts[0].after, (std::vector<int>{1}));
  robot.interrupts[0].match = "25";
  changes = changes_with(robot, {}, there);
  ASSERT_EQ(changes.interrupts.size(), 1u);
  EXPECT_EQ(changes.interrupts[0].number, 25);
}

TEST(RobotChanges, AReservationIsForAllProcessors) {
  Robot robot = robot_from(kCart);
  robot.threads[0].level =
      Level{.kind = Level::Kind::Reservation, .reservation = {.budget = kMillisecond, .period = 9 * kMillisecond}};
  Snapshot snapshot;
  snapshot.cpus = {0, 1, 2, 3};
  snapshot.processes = {{1, "a", "/opt/arm 1", "/", {thread(10, "loop")}}};
  const Plan plan = *plan_of(robot, runtime::band_up_to(90));
  Changes changes = changes_of(robot, plan, snapshot);
  ASSERT_EQ(changes.threads.size(), 1u);
  EXPECT_EQ(to_string(changes.threads[0].after.scheduling), "1ms every 9ms");
  EXPECT_TRUE(changes.threads[0].after.scheduling.resets_on_fork);
  EXPECT_EQ(changes.threads[0].after.cpus, snapshot.cpus) << "although the robot has two of them";
  snapshot.processes[0].threads[0].state = changes.threads[0].after;
  EXPECT_TRUE(changes_of(robot, plan, snapshot).is_empty());
}

TEST(RobotChanges, SayWhatDoesNotHold) {
  const Changes changes =
      changes_with(robot_from(kCart),
                   {{1, "a", "/opt/arm 1", "/", {thread(10, "dds.a"), thread(11, "dds.b")}},
                    {2, "a", "/opt/arm 2", "/", {thread(20, "loop", {Scheduling::Class::Deadline, 0, 0, false})}}});
  EXPECT_THAT(changes.remarks,
              ElementsAre("thread 'loop' (20) has a reservation (SCHED_DEADLINE) and keeps it",
                          "irqs 'net': no interrupt matches 'eth*'", "process 'base' does not run",
                          "process 'arm' matches 2 processes, and the bounds count its workload once",
                          "threads 'dds': 2 run, and the bounds count 1 ('count:')", "threads 'guard': none runs",
                          "threads 'logs': none runs", "threads 'torch': none runs"));
}

}  // namespace
}  // namespace redag::robot
