// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The program run_workload, which compares executors.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>

namespace redag_rclcpp::lab {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::ContainsRegex;
using ::testing::HasSubstr;

constexpr const char *kWorkload =
    "name: w\n"
    "platform: {workers: 1}\n"
    "dags:\n"
    "  - {name: fast, tasks: [{name: a, wcet: 100us, period: 20ms}, {name: b, wcet: 100us, activation: data, after: "
    "a}]}\n"
    "  - {name: slow/1, tasks: [{name: c, wcet: 1ms, bcet: 10us, period: 50ms}]}\n";

class RunWorkload : public ::testing::Test {
 protected:
  RunWorkload() {
    fs::create_directories(folder_);
    write("w.yaml", kWorkload);
  }
  ~RunWorkload() override { fs::remove_all(folder_); }

  void write(const std::string &name, const std::string &text) const { std::ofstream(folder_ / name) << text; }
  [[nodiscard]] std::string path(const std::string &name) const { return (folder_ / name).string(); }
  [[nodiscard]] std::string text(const std::string &name) const {
    std::ifstream in(folder_ / name);
    return {std::istreambuf_iterator<char>(in), {}};
  }

  /// Runs the program. Returns its exit status; printed is what it wrote.
  int run(const std::string &arguments) {
    const std::string command = std::string(PROGRAM) + " " + arguments + " > " + path("out") + " 2> " + path("err");
    const int status = std::system(command.c_str());
    printed_ = text("out");
    complained_ = text("err");
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  }

  fs::path folder_ = fs::temp_directory_path() / ("run_workload_test." + std::to_string(getpid()));
  std::string printed_;
  std::string complained_;
};

TEST_F(RunWorkload, SeveralExecutorsAreComparedInOneTable) {
  ASSERT_EQ(run(path("w.yaml") + " --executor redag-none,mte --duration 400ms --out " + path("results")), 0)
      << complained_;
  for (const char *place : {"redag-none/1", "mte/1"}) {
    EXPECT_TRUE(fs::exists(folder_ / "results" / place / "summary.json")) << place;
  }
  EXPECT_THAT(printed_, AllOf(ContainsRegex("fast +redag-none +1 +40 "), ContainsRegex("fast +mte +1 +40 "),
                              ContainsRegex("slow/1 +mte +1 +8 ")));
}

TEST_F(RunWorkload, AnUnknownExecutorIsNamed) {
  EXPECT_EQ(run(path("w.yaml") + " --executor ste,most"), 2);
  EXPECT_THAT(complained_, HasSubstr("there is no executor 'most'"));
}

TEST_F(RunWorkload, ARunThatFailsEndsTheComparison) {
  write("jitter.yaml", "dags: [{name: b, tasks: [{name: u, wcet: 1ms, period: 10ms, jitter: 1ms}]}]");
  EXPECT_EQ(run(path("jitter.yaml") + " --executor redag-none,mte --duration 60s"), 2);
  EXPECT_THAT(complained_, AllOf(HasSubstr("a ROS timer has no release jitter"),
                                 HasSubstr("the run with executor redag-none failed")));
}

}  // namespace
}  // namespace redag_rclcpp::lab
