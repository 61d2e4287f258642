// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The comparison of stacks with contenders of its own, and the processes that it starts.
#include "stack_comparison.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <chrono>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "child_process.hpp"
#include "command_line.hpp"

namespace redag_rclcpp::lab {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::StartsWith;
using Strings = std::vector<std::string>;

class StackComparisonTest : public ::testing::Test {
 protected:
  StackComparisonTest() {
    comparison_.program = "bench_test";
    comparison_.description = "the help\n";
    comparison_.config = "none";
    comparison_.add_options = [this](CLI::App &app) {
      add_number<double>(app, "--rate", rate_, 0.001, "");
      add_number<int>(app, "--width", width_, 1, "", 1000);
    };
    comparison_.contenders = {"plain", "redag"};
    comparison_.measure = [this](const StackRun &run, const StackOptions &options) {
      runs_.push_back(run.contender);
      options_ = options;
      EXPECT_TRUE(std::filesystem::is_empty(run.folder));
      std::ofstream(run.log("robot")) << "printed";
      if (run.contender == failing_) throw std::runtime_error("it broke");
      return run.contender == "plain" ? Figures{{"late", static_cast<double>(runs_.size())}, {"only plain", 7}}
                                      : Figures{{"late", 0.5}};
    };
  }

  int run(Strings arguments) {
    arguments.insert(arguments.begin(), "bench_test");
    std::vector<char *> argv;
    for (std::string &argument : arguments) argv.push_back(argument.data());
    testing::internal::CaptureStdout();
    testing::internal::CaptureStderr();
    const int status = run_comparison(comparison_, static_cast<int>(argv.size()), argv.data());
    printed_ = testing::internal::GetCapturedStdout();
    complained_ = testing::internal::GetCapturedStderr();
    return status;
  }

  double rate_ = 30;
  int width_ = 640;
  std::string failing_;
  StackComparison comparison_;
  Strings runs_;
  StackOptions options_;
  std::string printed_;
  std::string complained_;
};

TEST_F(StackComparisonTest, ContendersTakeTurnsAndMediansArePrinted) {
  EXPECT_EQ(run({"--rounds", "3", "--seconds", "0.5", "--rate", "12.5", "--width", "320"}), 0);
  EXPECT_THAT(runs_, ElementsAre("plain", "redag", "plain", "redag", "plain", "redag"));
  EXPECT_EQ(options_.seconds, 0.5);
  EXPECT_EQ(rate_, 12.5);
  EXPECT_EQ(width_, 320);
  EXPECT_EQ(printed_,
            "medians                            plain       redag\n"
            "late                               3.000       0.500\n"
            "only plain                         7.000           -\n");
}

TEST_F(StackComparisonTest, OnlySelectsContenders) {
  EXPECT_EQ(run({"--only", "redag", "--rounds", "1"}), 0);
  EXPECT_THAT(runs_, ElementsAre("redag"));
}

TEST_F(StackComparisonTest, AFailedRunEndsItAndKeepsWhatWasPrinted) {
  failing_ = "redag";
  EXPECT_EQ(run({}), 1);
  EXPECT_THAT(runs_, ElementsAre("plain", "redag"));
  EXPECT_THAT(complained_, AllOf(HasSubstr("bench_test: redag: it broke"), HasSubstr("redag.1")));
  const std::size_t begin = complained_.find("is in ") + 6;
  const std::filesystem::path folder = complained_.substr(begin, complained_.find('\n', begin) - begin);
  EXPECT_TRUE(std::filesystem::exists(folder / "robot.log")) << folder;
  std::filesystem::remove_all(folder.parent_path());
}

TEST_F(StackComparisonTest, BadOptionsAreNamed) {
  const std::vector<std::pair<Strings, std::string>> cases = {
      {{"--rounds", "0"}, "--rounds: '0' is not a whole number of at least 1"},
      {{"--rounds", "1.5"}, "--rounds: '1.5' is not a whole number of at least 1"},
      {{"--seconds", "5x"}, "--seconds: '5x' is not a number of at least 0.001"},
      {{"--rate", "inf"}, "--rate: 'inf' is not a number of at least 0.001"},
      {{"--rate", "nan"}, "--rate: 'nan' is not a number of at least 0.001"},
      {{"--width", "-1"}, "--width: '-1' is not a whole number from 1 to 1000"},
      {{"--width", "1001"}, "--width: '1001' is not a whole number from 1 to 1000"},
      {{"--only", "plain,other"}, "--only: other not in {plain,redag}"},
      {{"--config", "/nowhere/x.yaml"}, "--config: there is no file '/nowhere/x.yaml'"},
  };
  for (const auto &[arguments, message] : cases) {
    EXPECT_EQ(run(arguments), 2) << message;
    EXPECT_EQ(complained_, "error: " + message + " ('bench_test --help' lists the options)\n");
  }
  // These words are CLI11's, which has others in each version.
  for (const Strings &arguments : {Strings{"--height", "3"}, Strings{"--rounds"}}) {
    EXPECT_EQ(run(arguments), 2);
    EXPECT_THAT(complained_, AllOf(StartsWith("error: "), HasSubstr(arguments.front())));
  }
  EXPECT_THAT(runs_, IsEmpty());
}

TEST_F(StackComparisonTest, HelpIsPrinted) {
  EXPECT_EQ(run({"--rounds", "1", "--help"}), 0);
  EXPECT_THAT(printed_, AllOf(HasSubstr("the help\n"), HasSubstr("--width N=640"), HasSubstr("--rounds N=3")));
  EXPECT_THAT(runs_, IsEmpty());
}

TEST(AddSamples, MedianAndP99) {
  Figures figures;
  Samples samples;
  add_samples(figures, "late", samples);
  EXPECT_THAT(figures, IsEmpty());
  for (int i = 0; i <= 100; ++i) samples.add(i * redag::kMillisecond);
  add_samples(figures, "late", samples);
  EXPECT_EQ(figures, (Figures{{"late, ms, p50", 50}, {"late, ms, p99", 99}}));
}

class ChildProcessTest : public ::testing::Test {
 protected:
  /// Runs a shell's script to the end that end() asks for.
  double run(const std::string &script) {
    ChildProcess child({"/bin/sh", "-c", script + "; echo ready; while :; do sleep 0.01; done"}, output_);
    while (printed().find("ready") == std::string::npos) std::this_thread::sleep_for(std::chrono::milliseconds(1));
    return child.end();
  }
  [[nodiscard]] std::string printed() const {
    std::ifstream in(output_);
    return {std::istreambuf_iterator<char>(in), {}};
  }
  void TearDown() override { std::filesystem::remove(output_); }

  std::string output_ =
      (std::filesystem::temp_directory_path() / ("child_process_test." + std::to_string(getpid()))).string();
};

TEST_F(ChildProcessTest, EndsByInterruptAndTellsProcessorTime) {
  const double used =
      run("trap 'exit 0' INT; i=0; while [ $i -lt 50000 ]; do i=$((i+1)); done; echo out; echo err >&2");
  EXPECT_GT(used, 0);
  EXPECT_EQ(printed(), "out\nerr\nready\n");
}

TEST_F(ChildProcessTest, OtherEndsAreErrors) {
  try {
    run("trap 'exit 3' INT");
    ADD_FAILURE();
  } catch (const std::runtime_error &error) {
    EXPECT_STREQ(error.what(), "a process ended with exit status 3");
  }
  try {
    run("trap 'kill -TERM $$' INT");
    ADD_FAILURE();
  } catch (const std::runtime_error &error) {
    EXPECT_STREQ(error.what(), "a process ended by signal 15");
  }
  EXPECT_THROW(ChildProcess({"/nowhere/program"}, output_), std::runtime_error);
}

}  // namespace
}  // namespace redag_rclcpp::lab
