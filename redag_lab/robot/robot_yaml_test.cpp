// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/robot/robot_yaml.hpp"

#include <gtest/gtest.h>

#include <string>

#include "redag/loader/text_file.hpp"
#include "redag_lab/robot/input.hpp"
#include "tests/testing/repository.hpp"

namespace redag::robot {
namespace {

constexpr const char *kBase = R"(robot: cart
cpu_sets:
  - {name: fast, cpus: 0-1}
  - {name: rest, cpus: "2,3"}
processes:
  - name: base
    cpus: fast
    workload:
      dags:
        - name: control
          tasks: [{name: pid, wcet: 1ms, period: 5ms}]
  - name: driver
    cpus: rest
    workload: {dags: [{name: scan, tasks: [{name: rx, wcet: 1ms, period: 9ms}]}]}
)";

Result<LoadedRobot> read(const std::string &text) {
  const Result<yaml::Node> root = yaml::parse(text, "cart.yaml");
  if (!root) return tl::unexpected(root.error());
  return read_robot(*root, "cart.yaml");
}

// All findings, one a line.
std::string findings(const std::string &text) {
  const Result<LoadedRobot> loaded = read(text);
  return to_string(loaded ? loaded->warnings : loaded.error());
}

std::string with_threads(const std::string &entry) { return std::string(kBase) + "threads:\n  - " + entry + "\n"; }

TEST(RobotYaml, ReadsEverything) {
  const Result<LoadedRobot> loaded = read(std::string(kBase) + R"(threads:
  - {name: loop, level: {task: base.control.pid}}
  - {name: dds, level: {rate: 20ms}, wcet: 100us, count: 2, cpus: rest}
  - {name: slow, level: {rate: 20ms}, wcet: 100us, period: 1s, cpus: fast}
  - {name: guard, level: above, wcet: 1us, period: 1ms, cpus: fast}
)");
  ASSERT_TRUE(loaded) << to_string(loaded.error());
  const Robot &robot = loaded->robot;
  EXPECT_EQ(robot.name, "cart");
  EXPECT_EQ(robot.cpu_sets[1].cpus, (std::vector<int>{2, 3}));
  EXPECT_EQ(robot.processes[0].cpu_set, 0u);
  EXPECT_FALSE(robot.processes[0].states_workers);
  EXPECT_EQ(robot.processes[1].cpu_set, 1u);
  ASSERT_EQ(robot.threads.size(), 4u);
  EXPECT_EQ(robot.threads[0].level.kind, Level::Kind::Task);
  EXPECT_EQ(robot.threads[0].level.task.process, 0u);
  EXPECT_EQ(robot.threads[0].level.task.task, TaskId(0));
  EXPECT_EQ(robot.threads[1].period, 20 * kMillisecond);
  EXPECT_EQ(robot.threads[1].count, 2u);
  EXPECT_EQ(robot.threads[1].cpu_set, 1u);
  EXPECT_EQ(robot.threads[2].level.rate, 20 * kMillisecond);
  EXPECT_EQ(robot.threads[2].period, kSecond);
  EXPECT_EQ(robot.threads[3].level.kind, Level::Kind::Above);
  EXPECT_FALSE(has_executor(robot, 0)) << "its only task is that of threads";
}

TEST(RobotYaml, SaysWhereAndHowToMend) {
  EXPECT_EQ(findings("robot: cart\n"),
            "cart.yaml:1:1: error: the robot names no processors (add 'cpus: 0-3' if all processes share them, or else "
            "'cpu_sets:')");
  EXPECT_EQ(findings("robot: cart\ncpus: 0\n"),
            "cart.yaml:1:1: error: the robot has no processes (add one under 'processes:')");
  const std::string process =
      "processes:\n  - {name: a, workload: {dags: [{name: d, tasks: [{name: t, wcet: 1ms, period: "
      "5ms}]}]}";
  EXPECT_EQ(findings("robot: cart\ncpus: 0\n" + process + ", cpus: fast}\n"),
            "cart.yaml:4:96: error: process 'a' names 'fast', which is no CPU set (remove 'cpus:', or replace the "
            "robot's 'cpus' by "
            "'cpu_sets')");
  EXPECT_EQ(findings("robot: cart\ncpus: 0\nprocesses:\n  - {name: a, workloads: a.yaml}\n"),
            "cart.yaml:4:5: error: the process has no 'workload' (name a workload file, or write its 'dags:')\n"
            "cart.yaml:4:15: error: unknown key 'workloads' in a process (did you mean 'workload'?)");
  EXPECT_EQ(findings("robot: cart\npolicy: edf\ncpus: 0\n" + process + "}\n"),
            "cart.yaml:2:9: error: policy must be one of rate_monotonic, deadline_monotonic, fixed, not 'edf'");
  EXPECT_EQ(findings(with_threads("{name: t, level: above, wcet: 1ms, period: 2ms}")),
            "cart.yaml:16:5: error: the entry 't' names no CPU set (write 'cpus:' with one of fast, rest)");
}

TEST(RobotYaml, RefusesCpuSetsThatShareProcessors) {
  EXPECT_EQ(findings("robot: cart\ncpu_sets: [{name: a, cpus: 0-1}, {name: b, cpus: 1}]\n"
                     "processes: [{name: p, cpus: a, workload: {dags: [{name: d, tasks: [{name: t, wcet: 1ms, period: "
                     "5ms}]}]}}]\n"),
            "cart.yaml:2:50: error: processor 1 of CPU set 'b' is also one of another set (CPU sets share no "
            "processors)");
}

TEST(RobotYaml, SuggestsTasks) {
  EXPECT_EQ(findings(with_threads("{name: t, level: {task: base.control.pod}}")),
            "cart.yaml:16:29: error: there is no task 'base.control.pod' (did you mean 'base.control.pid'?)");
}

TEST(RobotYaml, WantsALoadThatIsComplete) {
  const std::string unknown =
      "cart.yaml:16:5: error: threads 't' can delay tasks, and nothing says for how long (add "
      "'wcet:' and 'period:': what one of them executes at most, and how often)";
  EXPECT_EQ(findings(with_threads("{name: t, cpus: fast, level: above, wcet: 1ms}")), unknown);
  EXPECT_EQ(findings(with_threads("{name: t, cpus: fast, level: {rate: 1ms}}")), unknown);
  EXPECT_EQ(findings(with_threads("{name: t, cpus: fast, level: {rate: 1ms}, wcet: 2ms}")),
            "cart.yaml:16:53: error: wcet 2ms of threads 't' exceeds their period 1ms");
  EXPECT_EQ(findings(with_threads("{name: t, level: {task: base.control.pid}, wcet: 2ms}")),
            "cart.yaml:16:54: error: threads 't' have 'wcet', which their task says (remove 'wcet:')");
  EXPECT_EQ(findings(with_threads("{name: t, level: {nice: 5}}")),
            "cart.yaml:16:23: error: unknown key 'nice' in level (known: task, rate, reservation)");
}

TEST(RobotYaml, AReservationIsABudgetInAPeriod) {
  const auto with = [](const std::string &reservation) {
    return findings(with_threads("{name: t, level: {reservation: " + reservation + "}}"));
  };
  EXPECT_EQ(with("{budget: 2ms, period: 10ms}"), "");
  EXPECT_EQ(with("{budget: 2ms, period: 10ms, tick: 1ms}"), "");
  EXPECT_EQ(with("{budget: 2ms}"),
            "cart.yaml:16:36: error: the reservation has no 'period' (write {budget: 2ms, period: 10ms})");
  EXPECT_EQ(with("{budget: 20ms, period: 10ms}"),
            "cart.yaml:16:45: error: the budget of a reservation must be between 1.024us and its period 10ms");
  EXPECT_EQ(with("{budget: 2us, period: 10us}"),
            "cart.yaml:16:58: error: the period of a reservation must be between 100us and 4s");
  EXPECT_EQ(with("{budget: 2ms, period: 10ms, tick: 20ms}"),
            "cart.yaml:16:70: error: the tick is at most 10ms, as no kernel has a longer one");
  EXPECT_EQ(findings(with_threads("{name: t, level: {reservation: {budget: 2ms, period: 9ms}}, wcet: 1ms, cpus: 0}")),
            "cart.yaml:16:71: error: threads 't' have 'wcet', which the reservation says (remove 'wcet:')\n"
            "cart.yaml:16:82: error: threads 't' have 'cpus', which the reservation says (remove 'cpus:')");
}

TEST(RobotYaml, ReportsMistakesOfInlineWorkloadsAtTheirLines) {
  EXPECT_EQ(findings("robot: cart\ncpus: 0\nprocesses:\n  - name: a\n    workload:\n"
                     "      dags:\n        - name: d\n          tasks: [{name: t, wcet: 1, period: 5ms}]\n"),
            "cart.yaml:8:35: error: wcet: '1' is not a duration: it has no unit (ns, us, ms, s, min, h) (write a "
            "number and a unit, as "
            "in 5ms)");
}

TEST(RobotYaml, AProcessHasAWorkerForEachOfItsProcessors) {
  const char *process =
      "processes:\n  - {name: a, workload: {dags: [{name: d, tasks: [{name: s, wcet: 9ms, period: "
      "10ms}, {name: t, wcet: 9ms, period: 10ms}]}]}}\n";
  EXPECT_EQ(findings("robot: cart\ncpus: 0-1\n" + std::string(process)), "");
  EXPECT_NE(findings("robot: cart\ncpus: 0\n" + std::string(process)).find("exceeds the capacity of 1 worker"),
            std::string::npos);
}

TEST(RobotYaml, AWorkloadHasTheProcessorsOfItsProcess) {
  const auto with = [](const char *cpus) {
    return findings(
        "robot: cart\ncpus: 0-1\nprocesses:\n  - name: a\n    workload:\n"
        "      platform: {cpus: " +
        std::string(cpus) + "}\n      dags: [{name: d, tasks: [{name: s, wcet: 1ms, rate: 100Hz}]}]\n");
  };
  EXPECT_EQ(with("0-1"), "");
  EXPECT_EQ(
      with("[1, 2]"),
      "cart.yaml:6:7: error: the workload of process 'a' has other cpus than the process: 1-2 (remove 'cpus:' from "
      "its platform, or write 'cpus: 0-1')");
}

TEST(RobotYaml, ALevelTakesARateOrAPeriod) {
  for (const char *rate : {"50Hz", "20ms"}) {
    const auto loaded =
        read(with_threads("{name: t, cpus: fast, wcet: 1ms, level: {rate: " + std::string(rate) + "}}"));
    ASSERT_TRUE(loaded) << to_string(loaded.error());
    EXPECT_EQ(loaded->robot.threads[0].level.rate, 20 * kMillisecond);
  }
  EXPECT_NE(
      findings(with_threads("{name: t, cpus: fast, wcet: 1ms, level: {rate: 20}}")).find("error: rate: '20' is not a"),
      std::string::npos);
}

TEST(RobotYaml, ReportsMistakesOfFilesInThem) {
  const std::string text = findings(
      "robot: cart\ncpus: 0\nprocesses:\n"
      "  - {name: a, workload: /nowhere/a.yaml}");
  EXPECT_EQ(text,
            "cart.yaml:4:25: error: the workload '/nowhere/a.yaml' cannot be used (its mistakes are listed below)\n"
            "/nowhere/a.yaml: error: cannot open: No such file or directory");
}

TEST(RobotYaml, TheShippedExampleIsSound) {
  const std::string path = (testing::repository() / "examples" / "robot" / "cart.yaml").string();
  const Result<Input> input = parse_input(read_file(path, kMaxWorkloadBytes).value(), path);
  ASSERT_TRUE(input) << to_string(input.error());
  EXPECT_TRUE(input->loaded.warnings.empty()) << to_string(input->loaded.warnings);
  EXPECT_EQ(input->loaded.workload.task_count(), 7U);
}

}  // namespace
}  // namespace redag::robot
