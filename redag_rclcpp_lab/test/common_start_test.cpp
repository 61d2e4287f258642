// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Processes that begin together, with shells in the place of runs; and the parts of workloads that they run.
#include "common_start.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <array>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <stdexcept>
#include <string>
#include <vector>

#include "phased_timer.hpp"
#include "redag/model/workload_yaml.hpp"
#include "workload_part.hpp"

namespace redag_rclcpp::lab {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::SizeIs;
using Strings = std::vector<std::string>;

bool never() { return false; }

Strings shell(const std::string &script) { return {"/bin/sh", "-c", script}; }

class CommonStartTest : public ::testing::Test {
 protected:
  CommonStartTest() { std::filesystem::create_directories(folder_); }
  ~CommonStartTest() override { std::filesystem::remove_all(folder_); }

  [[nodiscard]] std::string path(const std::string &name) const { return (folder_ / name).string(); }
  [[nodiscard]] std::string text(const std::string &name) const {
    std::ifstream in(path(name));
    return {std::istreambuf_iterator<char>(in), {}};
  }

  std::filesystem::path folder_ =
      std::filesystem::temp_directory_path() / ("common_start_test." + std::to_string(getpid()));
};

TEST_F(CommonStartTest, AllGetOneStartWhenTheLastIsReady) {
  const redag::Time before = timer_clock_now();
  const auto statuses =
      run_together({shell("echo ready; read line; echo \"$line\" > " + path("first") + "; exit 3"),
                    shell("until [ -e " + path("late") +
                          " ]; do sleep 0.01; done; echo ready; "
                          "read line; echo \"$line\" > " +
                          path("second")),
                    shell("sleep 0.1; touch " + path("late") + "; echo ready; cat > " + path("third"))},
                   redag::kSecond, never);
  ASSERT_TRUE(statuses);
  EXPECT_THAT(*statuses, ElementsAre(3, 0, 0));
  EXPECT_EQ(text("first"), text("second"));
  EXPECT_EQ(text("first"), text("third"));
  ASSERT_EQ(text("first").rfind("start ", 0), 0U);
  const redag::Time start = std::stoll(text("first").substr(6));
  EXPECT_GT(start, before + redag::kSecond);
  EXPECT_LE(start, timer_clock_now() + redag::kSecond);
}

TEST_F(CommonStartTest, AnEarlyEndCallsTheStartOff) {
  const auto statuses =
      run_together({shell("echo ready; read line || exit 7"), shell("exit 5"), shell("kill -KILL $$")}, 0, never);
  ASSERT_TRUE(statuses);
  EXPECT_THAT(*statuses, ElementsAre(7, 5, -1));
}

TEST_F(CommonStartTest, AnInterruptCallsTheStartOff) {
  // The shell reads no input before its signal: a process that is not ready cannot keep the others waiting.
  static std::string waits;
  waits = path("waits");
  const auto statuses = run_together({shell("trap 'exit 4' INT; touch " + waits + "; while :; do sleep 0.01; done"),
                                      shell("trap '' INT; echo ready; read line || exit 7")},
                                     0, [] { return std::filesystem::exists(waits); });
  ASSERT_TRUE(statuses);
  EXPECT_THAT(*statuses, ElementsAre(4, 7));
}

TEST_F(CommonStartTest, AnInterruptReachesAllThatRun) {
  static std::string runs;
  runs = path("runs");
  const std::string script =
      "trap 'exit 6' INT; echo ready; read line; echo x >> " + runs + "; while :; do sleep 0.01; done";
  const auto statuses = run_together({shell(script), shell(script)}, 0, [] {
    return std::filesystem::exists(runs) && std::filesystem::file_size(runs) == 4;
  });
  ASSERT_TRUE(statuses);
  EXPECT_THAT(*statuses, ElementsAre(6, 6));
}

TEST_F(CommonStartTest, AProgramThatDoesNotExistIsAStatus) {
  const auto statuses = run_together({{"/nowhere/program"}, shell("echo ready; read line || exit 7")}, 0, never);
  ASSERT_TRUE(statuses);
  EXPECT_THAT(*statuses, ElementsAre(127, 7));
}

// await_start() on standard input and output that are replaced.
class AwaitStartTest : public ::testing::Test {
 protected:
  AwaitStartTest() : kept_{dup(STDIN_FILENO), dup(STDOUT_FILENO)} {
    if (pipe(in_.data()) != 0 || pipe(out_.data()) != 0) throw std::runtime_error("no pipe");
  }
  ~AwaitStartTest() override {
    for (const int end : {in_[0], out_[0], out_[1], kept_[0], kept_[1]}) close(end);
  }

  redag::Result<redag::Time> await(const std::string &input) {
    EXPECT_EQ(write(in_[1], input.data(), input.size()), static_cast<ssize_t>(input.size()));
    close(in_[1]);
    fflush(stdout);
    dup2(in_[0], STDIN_FILENO);
    dup2(out_[1], STDOUT_FILENO);
    redag::Result<redag::Time> start = await_start();
    dup2(kept_[0], STDIN_FILENO);
    dup2(kept_[1], STDOUT_FILENO);
    std::array<char, 64> said{};
    EXPECT_EQ(std::string(said.data(), static_cast<std::size_t>(read(out_[0], said.data(), said.size()))), "ready\n");
    return start;
  }
  std::string mistake(const std::string &input) {
    const auto start = await(input);
    return start ? "none" : to_string(start.error());
  }

  std::array<int, 2> in_{};
  std::array<int, 2> out_{};
  std::array<int, 2> kept_;
};

TEST_F(AwaitStartTest, ReturnsTheTime) {
  const auto start = await("start 12345678901\n");
  ASSERT_TRUE(start);
  EXPECT_EQ(*start, 12'345'678'901);
}

TEST_F(AwaitStartTest, TheEndOfTheInputIsAnError) {
  EXPECT_THAT(mistake(""), HasSubstr("there is no common start: the standard input ended"));
}

TEST_F(AwaitStartTest, ALineWithoutItsEndIsAnError) {
  EXPECT_THAT(mistake("start 5"), HasSubstr("the standard input ended"));
}

TEST_F(AwaitStartTest, OtherLinesAreErrors) { EXPECT_THAT(mistake("start 5x\n"), HasSubstr("'start 5x' is not")); }

redag::Workload workload_of(const std::string &text) {
  auto loaded = redag::parse_workload(text, "test.yaml");
  if (!loaded) throw std::runtime_error(redag::to_string(loaded.error()));
  return std::move(loaded->workload);
}

TEST(WorkloadPart, HasOneDagAndTheJobsOfTheWhole) {
  const redag::Workload whole = workload_of(
      "{platform: {workers: 3}, dags: [{name: a, tasks: [{name: t, wcet: 1ms, bcet: 1us, period: 10ms}, {name: u, "
      "wcet: 1ms, period: 20ms}]}, {name: 'b/c', tasks: [{name: v, wcet: 1ms, bcet: 1us, period: 10ms}]}]}");
  const WorkloadPart part = part_of(whole, 1);
  ASSERT_THAT(part.workload.dags, SizeIs(1));
  EXPECT_EQ(part.workload.dags[0].name, "b/c");
  EXPECT_EQ(part.workload.platform.workers, 3U);
  EXPECT_EQ(part.first_task, 2U);
  EXPECT_EQ(part_of(whole, 0).first_task, 0U);
  EXPECT_EQ(folder_of_part(whole, 1), "2-b_c");
}

TEST(WorkloadPart, AGroupOfSeveralDagsHasNoParts) {
  const std::string task = "{wcet: 1ms, period: 10ms, ";
  EXPECT_TRUE(check_parts(workload_of("{dags: [{name: a, tasks: [" + task + "name: t, group: g}, " + task +
                                      "name: u, group: g}]}, {name: b, tasks: [" + task + "name: v}]}]}")));
  const auto refused =
      check_parts(workload_of("{dags: [{name: a, tasks: [" + task + "name: t, group: g}]}, {name: b, " + "tasks: [" +
                              task + "name: v, group: g}]}]}"));
  ASSERT_FALSE(refused);
  EXPECT_THAT(to_string(refused.error()), HasSubstr("the group 'g' has tasks of the DAGs 'a' and 'b'"));
}

}  // namespace
}  // namespace redag_rclcpp::lab
