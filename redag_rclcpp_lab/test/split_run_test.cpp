// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The program run_workload with a process for each DAG.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <future>
#include <iterator>
#include <string>

#include "redag/runtime/setup.hpp"
#include "redag/trace/events_file.hpp"

namespace redag_rclcpp::lab {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::ContainsRegex;
using ::testing::HasSubstr;

constexpr const char *kWorkload =
    "name: split\n"
    "platform: {workers: 1}\n"
    "dags:\n"
    "  - {name: fast, tasks: [{name: a, wcet: 100us, period: 20ms}, {name: b, wcet: 100us, activation: data, after: "
    "a}]}\n"
    "  - {name: slow/1, tasks: [{name: c, wcet: 1ms, bcet: 10us, period: 50ms}]}\n";

class SplitRun : public ::testing::Test {
 protected:
  SplitRun() {
    fs::create_directories(folder_ / "order");
    write("w.yaml", kWorkload);
  }
  ~SplitRun() override { fs::remove_all(folder_); }

  void write(const std::string &name, const std::string &text) const { std::ofstream(folder_ / name) << text; }
  [[nodiscard]] std::string path(const std::string &name) const { return (folder_ / name).string(); }
  [[nodiscard]] std::string text(const std::string &name) const {
    std::ifstream in(folder_ / name);
    return {std::istreambuf_iterator<char>(in), {}};
  }

  /// Runs the program. Returns its exit status; printed is what it wrote.
  int run(const std::string &arguments) {
    const std::string command = "REDAG_SHARE_ORDER=" + path("order") + " " + PROGRAM + " " + arguments + " > " +
                                path("out") + " 2> " + path("err");
    const int status = std::system(command.c_str());
    printed_ = text("out");
    complained_ = text("err");
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  }

  fs::path folder_ = fs::temp_directory_path() / ("split_run_test." + std::to_string(getpid()));
  std::string printed_;
  std::string complained_;
};

TEST_F(SplitRun, EachDagHasAProcessAndOneTableShowsAll) {
  ASSERT_EQ(run(path("w.yaml") + " --executor redag-none,redag-none-split,mte-split --duration 400ms --out " +
                path("results")),
            0)
      << complained_;
  for (const char *place : {"redag-none/1", "redag-none-split/1/1-fast", "redag-none-split/1/2-slow_1",
                            "mte-split/1/1-fast", "mte-split/1/2-slow_1"}) {
    EXPECT_TRUE(fs::exists(folder_ / "results" / place / "summary.json")) << place;
  }
  EXPECT_THAT(printed_,
              AllOf(ContainsRegex("fast +redag-none +1 +40 "), ContainsRegex("fast +redag-none-split +1 +40 "),
                    ContainsRegex("fast +mte-split +1 +40 "), ContainsRegex("slow/1 +redag-none-split +1 +8 ")));
  const auto process = [&](const std::string &place) {
    auto trace = redag::trace::read_trace(path("results/" + place + "/events.redag"));
    EXPECT_TRUE(trace) << place;
    return std::move(trace->info);
  };
  const auto whole = process("redag-none/1");
  const auto part = process("redag-none-split/1/2-slow_1");
  EXPECT_EQ(whole.workload.dags.size(), 2U);
  ASSERT_EQ(part.workload.dags.size(), 1U);
  EXPECT_EQ(part.workload.dags[0].name, "slow/1");
}

TEST_F(SplitRun, OneNameIsEnough) {
  ASSERT_EQ(run(path("w.yaml") + " --executor redag-none-split --duration 200ms"), 0) << complained_;
  EXPECT_THAT(printed_, ContainsRegex("slow/1 +redag-none-split +1 +4 "));
}

TEST_F(SplitRun, ProcessesWithOsShareAnOrder) {
  if (redag::runtime::probe_priority_band().top_job == 0) GTEST_SKIP() << "this process may not use SCHED_FIFO";
  auto running =
      std::async(std::launch::async, [&] { return run(path("w.yaml") + " --executor redag-os-split --duration 1s"); });
  std::ptrdiff_t most = 0;
  while (running.wait_for(std::chrono::milliseconds(5)) != std::future_status::ready) {
    most = std::max(most, std::distance(fs::directory_iterator(folder_ / "order"), fs::directory_iterator()));
  }
  EXPECT_EQ(running.get(), 0) << complained_;
  EXPECT_GE(most, 2) << "statements in the folder of the order";
}

TEST_F(SplitRun, AGroupOfSeveralDagsIsRefused) {
  write("groups.yaml",
        "dags: [{name: a, tasks: [{name: t, wcet: 1ms, period: 10ms, group: g}]}, {name: b, tasks: [{name: u, wcet: "
        "1ms, period: 10ms, group: g}]}]");
  EXPECT_EQ(run(path("groups.yaml") + " --executor mte-split --duration 100ms"), 2);
  EXPECT_THAT(complained_, HasSubstr("the group 'g' has tasks of the DAGs 'a' and 'b'"));
}

TEST_F(SplitRun, AnUnknownExecutorIsNamedAsItIsListed) {
  EXPECT_EQ(run(path("w.yaml") + " --executor ste-split,most-split"), 2);
  EXPECT_THAT(complained_, HasSubstr("there is no executor 'most'"));
}

TEST_F(SplitRun, AProcessThatFailsEndsTheOthersAndTheComparison) {
  // A task of the second DAG asks for what ROS 2 cannot do.
  write("jitter.yaml",
        "dags: [{name: a, tasks: [{name: t, wcet: 1ms, period: 10ms}]}, {name: b, tasks: [{name: u, wcet: 1ms, "
        "period: 10ms, jitter: 1ms}]}]");
  EXPECT_EQ(run(path("jitter.yaml") + " --executor redag-none-split --duration 60s"), 2);
  EXPECT_THAT(complained_, AllOf(HasSubstr("a ROS timer has no release jitter"),
                                 HasSubstr("the run with executor redag-none-split failed")));
}

}  // namespace
}  // namespace redag_rclcpp::lab
