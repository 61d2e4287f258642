// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/robot/robot_yaml.hpp"

#include <gtest/gtest.h>

#include <string>

#include "redag_lab/robot/input.hpp"
#include "redag_testing/repository.hpp"

namespace redag::robot {
namespace {

constexpr const char *kBase = R"(robot: cart
cpu_sets:
  - {name: fast, cpus: 0-1}
  - {name: rest, cpus: "2,3"}
processes:
  - name: base
    match: {name: base_node}
    cpus: fast
    workload:
      dags:
        - name: control
          tasks: [{name: pid, wcet: 1ms, period: 5ms}]
  - name: driver
    match: {command: "*/driver *", cgroup: "/robot*"}
    cpus: rest
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
  - {name: loop, match: {process: driver, thread: "rx?"}, level: {task: base.control.pid}}
  - {name: dds, match: {thread: "dds.*"}, level: {rate: 20ms}, wcet: 100us, count: 2, cpus: fast}
  - {name: guard, match: {name: guard}, level: above, wcet: 1us, period: 1ms}
  - {name: logs, match: {cgroup: "*/logs"}, level: below}
  - {name: bus, match: {thread: bus}, level: {fifo: 85}}
  - {name: torch, match: {thread: "pt_*"}, level: {nice: -3}, cpus: "3"}
irqs:
  - {name: net, match: "eth*", cpus: rest}
)");
  ASSERT_TRUE(loaded) << to_string(loaded.error());
  const Robot &robot = loaded->robot;
  EXPECT_EQ(robot.name, "cart");
  EXPECT_EQ(robot.cpu_sets[1].cpus, (std::vector<int>{2, 3}));
  EXPECT_EQ(robot.processes[0].cpu_set, 0u);
  EXPECT_FALSE(robot.processes[0].states_workers);
  EXPECT_EQ(robot.processes[1].match.command, "*/driver *");
  EXPECT_EQ(robot.processes[1].match.cgroup, "/robot*");
  EXPECT_EQ(robot.processes[1].cpu_set, 1u);
  EXPECT_FALSE(robot.processes[1].workload);
  ASSERT_EQ(robot.threads.size(), 6u);
  EXPECT_EQ(robot.threads[0].process, 1u);
  EXPECT_EQ(robot.threads[0].level->kind, Level::Kind::Task);
  EXPECT_EQ(robot.threads[0].level->process, 0u);
  EXPECT_EQ(robot.threads[0].level->task, TaskId(0));
  EXPECT_EQ(robot.threads[1].period, 20 * kMillisecond);
  EXPECT_EQ(robot.threads[1].count, 2u);
  EXPECT_EQ(robot.threads[1].cpus, (std::vector<int>{0, 1}));
  EXPECT_EQ(robot.threads[2].level->kind, Level::Kind::Above);
  EXPECT_EQ(robot.threads[3].level->kind, Level::Kind::Below);
  EXPECT_EQ(robot.threads[4].level->value, 85);
  EXPECT_EQ(robot.threads[5].level->value, -3);
  EXPECT_EQ(robot.threads[5].cpus, (std::vector<int>{3}));
  EXPECT_EQ(robot.interrupts[0].cpus, (std::vector<int>{2, 3}));
  EXPECT_FALSE(has_executor(robot, 0)) << "its only task is that of threads";
}

TEST(RobotYaml, SaysWhereAndHowToMend) {
  EXPECT_EQ(findings("robot: cart\n"),
            "cart.yaml:1:1: error: the robot names no processors (add 'cpus: 0-3' if all processes share them, or else "
            "'cpu_sets:')");
  EXPECT_EQ(findings("robot: cart\ncpus: 0\n"),
            "cart.yaml:1:1: error: the robot has no processes (add one under 'processes:')");
  EXPECT_EQ(
      findings("robot: cart\ncpus: 0\nprocesses:\n  - {name: a, match: {name: a}, cpus: fast}\n"),
      "cart.yaml:4:39: error: there is no CPU set 'fast', which process 'a' names (remove 'cpus:', or replace the "
      "robot's 'cpus' by 'cpu_sets')");
  EXPECT_EQ(findings("robot: cart\ncpus: 0\nprocesses:\n  - {name: a, mach: {name: a}}\n"),
            "cart.yaml:4:5: error: process 'a' has no match (add 'match: {name: PROGRAM}' or 'match: {command: "
            "\"*/PROGRAM *\"}')\n"
            "cart.yaml:4:15: error: unknown key 'mach' in a process (did you mean 'match'?)");
  EXPECT_EQ(findings("robot: cart\npolicy: edf\ncpus: 0\nprocesses:\n  - {name: a, match: {name: a}}\n"),
            "cart.yaml:2:9: error: policy must be one of rate_monotonic, deadline_monotonic, fixed, not 'edf'");
}

TEST(RobotYaml, RefusesCpuSetsThatShareProcessors) {
  EXPECT_EQ(findings("robot: cart\ncpu_sets: [{name: a, cpus: 0-1}, {name: b, cpus: 1}]\n"
                     "processes: [{name: p, match: {name: p}, cpus: a}]\n"),
            "cart.yaml:2:50: error: processor 1 of CPU set 'b' is also one of another set (CPU sets share no "
            "processors)");
}

TEST(RobotYaml, SuggestsTasksAndProcesses) {
  EXPECT_EQ(findings(with_threads("{name: t, match: {thread: a}, level: {task: base.control.pod}}")),
            "cart.yaml:17:49: error: there is no task 'base.control.pod' (did you mean 'base.control.pid'?)");
  EXPECT_EQ(findings(with_threads("{name: t, match: {process: bass, thread: a}, level: below}")),
            "cart.yaml:17:32: error: there is no process 'bass' (did you mean 'base'?)");
}

TEST(RobotYaml, RefusesWhatCannotMatch) {
  EXPECT_EQ(findings(with_threads("{name: t, match: {thread: a_name_of_sixteen}, level: below}")),
            "cart.yaml:17:31: error: thread 'a_name_of_sixteen' matches nothing: the kernel keeps 15 characters of a "
            "name (write 'a_name_of_sixte', or match the command)");
  EXPECT_EQ(findings(with_threads("{name: t, match: {}, level: below}")),
            "cart.yaml:17:22: error: match would match everything (add one of name, command, cgroup, thread, "
            "process)");
}

TEST(RobotYaml, WantsALoadThatIsComplete) {
  EXPECT_EQ(findings(with_threads("{name: t, match: {thread: a}, level: above, wcet: 1ms}")),
            "cart.yaml:17:55: error: threads 't' have a wcet, but no period (add 'period:')");
  EXPECT_EQ(
      findings(with_threads("{name: t, match: {thread: a}, level: {nice: 1}, wcet: 1ms, period: 5ms}")),
      "cart.yaml:17:59: error: threads 't' delay no task at this level, and need no wcet or period (remove 'wcet:' "
      "and 'period:')");
  EXPECT_EQ(findings(with_threads("{name: t, match: {thread: a}, level: {rate: 1ms}, wcet: 2ms}")),
            "cart.yaml:17:61: error: wcet 2ms of threads 't' exceeds their period 1ms");
}

TEST(RobotYaml, ReportsMistakesOfInlineWorkloadsAtTheirLines) {
  EXPECT_EQ(findings("robot: cart\ncpus: 0\nprocesses:\n  - name: a\n    match: {name: a}\n    workload:\n"
                     "      dags:\n        - name: d\n          tasks: [{name: t, wcet: 1, period: 5ms}]\n"),
            "cart.yaml:9:35: error: wcet: '1' is not a duration: it has no unit (ns, us, ms, s, min, h) (write a "
            "number and a unit, as "
            "in 5ms)");
}

TEST(RobotYaml, ReportsMistakesOfFilesInThem) {
  const std::string text = findings(
      "robot: cart\ncpus: 0\nprocesses:\n"
      "  - {name: a, match: {name: a}, workload: /nowhere/a.yaml}");
  EXPECT_EQ(text,
            "cart.yaml:4:43: error: the workload '/nowhere/a.yaml' cannot be used (its mistakes are listed below)\n"
            "/nowhere/a.yaml: error: cannot open: No such file or directory");
}

TEST(RobotYaml, TheShippedExampleIsSound) {
  const std::string path = (testing::repository() / "examples" / "robot" / "cart.yaml").string();
  const Result<Input> input = load_input(path);
  ASSERT_TRUE(input) << to_string(input.error());
  EXPECT_TRUE(input->warnings.empty()) << to_string(input->warnings);
  ASSERT_TRUE(input->workload) << to_string(input->workload.error());
  EXPECT_TRUE(input->workload->warnings.empty()) << to_string(input->workload->warnings);
  EXPECT_EQ(input->workload->workload.task_count(), 7u);
}

}  // namespace
}  // namespace redag::robot
