// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/robot/union.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <algorithm>
#include <string>

#include "redag/derived/modes.hpp"
#include "redag/sched/policy.hpp"
#include "redag_analysis/analyze/analyze.hpp"
#include "redag_lab/search/analysed.hpp"
#include "tests/testing/bound_property.hpp"
#include "tests/testing/builders.hpp"
#include "tests/testing/random_workloads.hpp"

namespace redag::robot {
namespace {

using testing::make_dag;
using testing::make_workload;

Robot robot_of(std::vector<Workload> workloads, std::vector<CpuSet> sets = {CpuSet{"", {0, 1}}}) {
  Robot robot;
  robot.name = "cart";
  robot.cpu_sets = std::move(sets);
  for (Workload &workload : workloads) {
    Process process;
    process.name = fmt::format("p{}", robot.processes.size());
    process.place = {"cart.yaml", static_cast<int>(robot.processes.size()) + 10, 5};
    process.cpu_set = std::min(robot.processes.size(), robot.cpu_sets.size() - 1);
    process.workload = std::move(workload);
    robot.processes.push_back(std::move(process));
  }
  return robot;
}

Workload one_task(Duration period, Duration wcet = 1, std::string group = {}) {
  return make_workload({make_dag("d", {{.name = "t", .period = period, .wcet = wcet, .group = std::move(group)}})}, 2,
                       PreemptionMode::Os);
}

Threads threads_at(Level::Kind kind, Duration wcet, Duration period) {
  Threads threads;
  threads.name = "x";
  threads.level.kind = kind;
  threads.level.rate = period;
  threads.wcet = wcet;
  threads.period = period;
  threads.place = {"cart.yaml", 30, 5};
  return threads;
}

std::string refusal(const Robot &robot) {
  const Result<LoadedWorkload> united = union_of(robot);
  return united ? "accepted" : to_string(united.error());
}

// Random workloads in processes are the workload that one would write by hand: their DAGs one after the other, with
// names and groups of their own.
RC_GTEST_PROP(RobotUnion, IsTheWorkloadWrittenByHand, ()) {
  Rng rng(*rc::gen::arbitrary<std::uint64_t>());
  const std::uint32_t count = testing::between(rng, 1, 4);
  Robot robot = robot_of({});
  robot.policy = testing::chance(rng, 0.5) ? PolicyKind::RateMonotonic : PolicyKind::DeadlineMonotonic;
  Workload by_hand;
  by_hand.name = "cart";
  by_hand.policy = robot.policy;
  by_hand.platform = Platform{2, PreemptionMode::Os};
  for (std::uint32_t p = 0; p < count; ++p) {
    Workload workload = testing::random_workload(rng);
    workload.policy = robot.policy;
    workload.platform = Platform{testing::between(rng, 2, 5), PreemptionMode::Os};
    Process process;
    process.name = std::string(1, static_cast<char>('a' + p));
    process.workload = workload;
    process.states_workers = true;
    for (Dag &dag : workload.dags) {
      dag.name = process.name + "/" + dag.name;
      dag.executor = p;
      for (Task &task : dag.tasks) {
        if (!task.group.empty()) task.group = process.name + "/" + task.group;
      }
      by_hand.dags.push_back(dag);
    }
    robot.processes.push_back(std::move(process));
  }
  // What no hand can write: more than one executor starts the jobs, or one with more threads than processors.
  by_hand.platform.several_executors = count > 1 || robot.processes[0].workload.platform.workers > 2;
  const Result<LoadedWorkload> united = union_of(robot);
  RC_ASSERT(united.has_value());
  RC_ASSERT(united->workload == by_hand);
}

TEST(RobotUnion, RefusesMoreRatesThanLevels) {
  std::vector<Dag> dags;
  for (std::uint32_t d = 0; d < 79; ++d)
    dags.push_back(make_dag(fmt::format("d{}", d), {{.name = "t", .period = 200 + d}}));
  Robot robot = robot_of({make_workload(std::move(dags), 2, PreemptionMode::Os), one_task(200)});
  EXPECT_EQ(refusal(robot), "accepted");
  robot.threads.push_back(threads_at(Level::Kind::Rate, kMillisecond, 300 * kMillisecond));
  EXPECT_EQ(refusal(robot),
            "cart.yaml:10:5: error: the robot has 80 different rates, and executors tell 79 apart (give similar tasks "
            "one rate)");
}

TEST(RobotUnion, KeepsGroupsOfProcessesApart) {
  const Result<LoadedWorkload> united = union_of(robot_of({one_task(5, 1, "bus"), one_task(10, 1, "bus")}));
  ASSERT_TRUE(united);
  EXPECT_EQ(united->workload.dags[0].tasks[0].group, "p0/bus");
  EXPECT_EQ(united->workload.dags[1].tasks[0].group, "p1/bus");
}

TEST(RobotUnion, CpuSetsAreClusters) {
  const Result<LoadedWorkload> united = union_of(
      robot_of({one_task(5), one_task(10)}, {CpuSet{"fast", {0}}, CpuSet{"rest", {1, 2}}, CpuSet{"idle", {3}}}));
  ASSERT_TRUE(united) << to_string(united.error());
  const Platform &platform = united->workload.platform;
  ASSERT_EQ(platform.clusters.size(), 2u) << "a set without tasks is none";
  EXPECT_EQ(platform.clusters[1], (Cluster{"rest", 2, {1, 2}}));
  EXPECT_EQ(platform.workers, 3u);
  EXPECT_EQ(united->workload.dags[1].cluster, "rest");
}

TEST(RobotUnion, RefusesFewerWorkersThanProcessors) {
  Robot robot = robot_of({one_task(5), one_task(10)});
  robot.processes[1].workload.platform.workers = 1;
  EXPECT_EQ(refusal(robot), "accepted") << "a workload that states none has one worker for each processor";
  robot.processes[1].states_workers = true;
  EXPECT_EQ(refusal(robot),
            "cart.yaml:11:5: error: process 'p1' has 1 worker for 2 processors: a processor can be idle while a job "
            "waits, which no bound for all processes covers (write 'workers: 2' in its workload, or leave it out)");
}

TEST(RobotUnion, RefusesOtherOrdersAndModes) {
  Robot robot = robot_of({one_task(5)});
  robot.processes[0].workload.policy = PolicyKind::Edf;
  EXPECT_EQ(
      refusal(robot),
      "cart.yaml:10:5: error: process 'p0' orders its jobs by edf, and the robot by rate_monotonic (write 'policy: "
      "rate_monotonic' in the workload of the process, or change the robot's)");
  robot = robot_of({one_task(5)});
  robot.processes[0].workload.platform.preemption = PreemptionMode::Cooperative;
  EXPECT_NE(refusal(robot).find("runs with preemption cooperative"), std::string::npos) << refusal(robot);
  robot.threads.push_back(threads_at(Level::Kind::Task, 0, 0));
  robot.threads[0].level.task.task = TaskId(0);
  EXPECT_EQ(refusal(robot), "accepted") << "threads execute all its tasks: no executor chooses";
}

TEST(RobotUnion, ExecutorsWithFixedPrioritiesShareNoOrder) {
  Robot robot = robot_of({one_task(5), one_task(10)});
  robot.policy = PolicyKind::Fixed;
  for (Process &process : robot.processes) process.workload.policy = PolicyKind::Fixed;
  EXPECT_EQ(refusal(robot),
            "cart.yaml:11:5: error: executors with policy fixed share no order: their priorities have no meaning for "
            "each other (order the robot by rate_monotonic or deadline_monotonic)");
  robot.threads.push_back(threads_at(Level::Kind::Task, 0, 0));
  robot.threads[0].level.task.task = TaskId(0);
  EXPECT_EQ(refusal(robot), "accepted") << "only one of the processes has an executor";
}

TEST(RobotUnion, ThreadsOfARateAreTasks) {
  Robot robot = robot_of({one_task(5), one_task(20)});
  robot.threads.push_back(threads_at(Level::Kind::Rate, kMillisecond, 10 * kMillisecond));
  robot.threads[0].count = 2;
  const Result<LoadedWorkload> united = union_of(robot);
  ASSERT_TRUE(united) << to_string(united.error());
  EXPECT_EQ(united->workload.policy, PolicyKind::RateMonotonic);
  const Dag &dag = united->workload.dags.back();
  EXPECT_EQ(dag.name, "threads/x");
  ASSERT_EQ(dag.tasks.size(), 2u);
  EXPECT_EQ(dag.tasks[1].period, 10 * kMillisecond);
  EXPECT_EQ(dag.tasks[1].wcet, kMillisecond);
}

// They keep their own period, and only come where a task of another one does.
TEST(RobotUnion, ThreadsCanHaveTheLevelOfAnotherRate) {
  Robot robot = robot_of({one_task(5), one_task(20)});
  robot.threads.push_back(threads_at(Level::Kind::Rate, kMillisecond, 50 * kMillisecond));
  robot.threads[0].level.rate = 5 * kMillisecond;
  const Result<LoadedWorkload> united = union_of(robot);
  ASSERT_TRUE(united) << to_string(united.error());
  EXPECT_EQ(united->workload.dags.back().tasks[0].period, 50 * kMillisecond);
  EXPECT_EQ(united->workload.policy, PolicyKind::Fixed);
  const auto order = sched::assign_priorities(united->workload.dags, united->workload.policy, Ties::Share);
  EXPECT_EQ(order[0].level, 0u);
  EXPECT_EQ(order[1].level, 1u);
  EXPECT_EQ(order[2].level, 0u);
}

// The slack of a foreign thread says nothing about the robot: the least one of a task does.
TEST(RobotUnion, ThreadsThatKeepUpAreNotTheWeakest) {
  Robot robot = robot_of({one_task(10), one_task(20)});
  robot.threads.push_back(threads_at(Level::Kind::Above, 3 * kMillisecond, 4 * kMillisecond));
  const auto weakest = [&] {
    const Result<LoadedWorkload> united = union_of(robot);
    EXPECT_TRUE(united) << to_string(united.error());
    const Workload &workload = united->workload;
    return lab::weakest_row(lab::analyse(workload, analysis::platform_of(sched::config_of(workload))).value())->name;
  };
  EXPECT_EQ(weakest(), "p0/d.t");
  robot.threads[0].wcet = 5 * kMillisecond;
  EXPECT_EQ(weakest(), "threads/x.run") << "they take more than there is";
}

TEST(RobotUnion, ThreadsAboveComeFirstWhateverTheirPeriod) {
  Robot robot = robot_of({one_task(5), one_task(20)});
  robot.threads.push_back(threads_at(Level::Kind::Above, kMillisecond, 50 * kMillisecond));
  const Result<LoadedWorkload> united = union_of(robot);
  ASSERT_TRUE(united) << to_string(united.error());
  EXPECT_EQ(united->workload.policy, PolicyKind::Fixed);
  const auto order = sched::assign_priorities(united->workload.dags, united->workload.policy, Ties::Share);
  EXPECT_EQ(order[2].level, 0u);
  EXPECT_EQ(order[0].level, 1u);
  EXPECT_EQ(order[1].level, 2u);
}

TEST(RobotUnion, ReservationsComeBeforeAllOthersAndAreBounded) {
  Robot robot = robot_of({one_task(5), one_task(20)});
  robot.threads.push_back(threads_at(Level::Kind::Above, kMillisecond, 50 * kMillisecond));
  robot.threads.push_back(threads_at(Level::Kind::Reservation, 0, 0));
  robot.threads[1].name = "y";
  robot.threads[1].level.reservation = {.budget = kMillisecond, .period = 20 * kMillisecond, .tick = kMillisecond};
  const Result<LoadedWorkload> united = union_of(robot);
  ASSERT_TRUE(united) << to_string(united.error());
  const auto order = sched::assign_priorities(united->workload.dags, united->workload.policy, Ties::Share);
  EXPECT_EQ(order[3].level, 0u);
  EXPECT_EQ(order[2].level, 1u);
  const Task &task = united->workload.dags[3].tasks[0];
  EXPECT_EQ(task.wcet, 4 * kMillisecond);
  EXPECT_EQ(task.period, 80 * kMillisecond);
  EXPECT_EQ(task.jitter, 58 * kMillisecond);
  robot.threads[1].count = 3;
  EXPECT_EQ(refusal(robot),
            "cart.yaml:30:5: error: 3 threads have reservations, and there are 2 processors: they can delay each "
            "other, which no bound covers (give fewer threads a reservation)");
  robot.threads[1].count = 1;
  robot.cpu_sets = {CpuSet{"a", {0}}, CpuSet{"b", {1}}};
  EXPECT_EQ(refusal(robot),
            "cart.yaml:30:5: error: threads 'y' have a reservation, which the kernel gives only for all processors "
            "(give the robot 'cpus' instead of 'cpu_sets')");
}

}  // namespace
}  // namespace redag::robot
