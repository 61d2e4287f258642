// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "live_statistics.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/wait.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <optional>
#include <utility>

#include "live_frames.hpp"

namespace redag_rclcpp::lab {
namespace {

using redag::kSecond;
using redag::live::Frame;
using redag::live::Listed;
using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::StartsWith;

Listed listed(Frame frame, std::int64_t pid = 12, std::uint32_t number = 0, std::uint64_t start = 1) {
  return Listed{redag::live::page_path("/x", pid, number), pid, number,
                redag::live::Page{{pid, start, 1}, std::move(frame)}};
}

std::optional<double> value(const LiveStatistics &statistics, const std::string &name) {
  const auto at = std::find(statistics.names().begin(), statistics.names().end(), name);
  if (at == statistics.names().end()) return std::nullopt;
  return statistics.values()[static_cast<std::size_t>(at - statistics.names().begin())];
}

TEST(LiveStatistics, HaveTheFiguresInSeconds) {
  LiveStatistics statistics({}, 7);
  EXPECT_TRUE(statistics.update({listed(small_frame())}, 21 * kSecond));
  EXPECT_EQ(statistics.version(), 7U);
  ASSERT_EQ(statistics.names().size(), statistics.values().size());
  EXPECT_EQ(value(statistics, "executors"), 1);
  EXPECT_EQ(value(statistics, "unreadable_pages"), 0);
  EXPECT_EQ(value(statistics, "left_out"), 0);
  EXPECT_EQ(value(statistics, "robot/workers"), 2);
  EXPECT_EQ(value(statistics, "robot/uptime"), 10);
  EXPECT_EQ(value(statistics, "robot/page_age"), 1);
  EXPECT_EQ(value(statistics, "robot/alert"), 0);
  EXPECT_EQ(value(statistics, "robot/threads/0/cpu"), 0.5);
  EXPECT_EQ(value(statistics, "robot/devices/gpu/rate"), 4);
  EXPECT_EQ(value(statistics, "robot/control/max_active"), 1);
  EXPECT_EQ(value(statistics, "robot/control/late"), 3);
  EXPECT_EQ(value(statistics, "robot/control/pid/released"), 100);
  EXPECT_EQ(value(statistics, "robot/control/pid/misses"), 4);
  EXPECT_EQ(value(statistics, "robot/control/pid/cpu_time"), 1.5);
  EXPECT_EQ(value(statistics, "robot/control/pid/cpu"), 0.05);
  EXPECT_EQ(value(statistics, "robot/control/pid/rate"), 10);
  EXPECT_EQ(value(statistics, "robot/control/pid/response_p99"), 0.003);
  EXPECT_EQ(value(statistics, "robot/control/pid/recent_response_p99"), 0.0025);
  EXPECT_EQ(value(statistics, "robot/control/pid/deadline"), 0.008);
  EXPECT_EQ(value(statistics, "robot/control/pid/bound"), 0.002);
}

TEST(LiveStatistics, LeaveOutWhatARowDoesNotHave) {
  LiveStatistics statistics({}, 1);
  statistics.update({listed(small_frame())}, 20 * kSecond);
  EXPECT_EQ(value(statistics, "robot/ros/ns/imu/timer 2 ms (0)/period"), 0.002);
  EXPECT_EQ(value(statistics, "robot/ros/ns/imu/timer 2 ms (0)/deadline"), std::nullopt);
  EXPECT_EQ(value(statistics, "robot/ros/ns/imu/timer 2 ms (0)/bound"), std::nullopt);
  EXPECT_EQ(value(statistics, "robot/ros/late"), std::nullopt);
}

TEST(LiveStatistics, SelectFigures) {
  LiveStatistics statistics({"misses", "alert"}, 1);
  statistics.update({listed(small_frame())}, 20 * kSecond);
  EXPECT_THAT(statistics.names(),
              ElementsAre("robot/alert", "robot/control/misses", "robot/ros/misses", "robot/control/pid/misses",
                          "robot/ros/ns/imu/timer 2 ms (0)/misses", "executors", "unreadable_pages", "left_out"));
  for (const std::string &name : statistics.names()) {
    const std::string figure = name.substr(name.rfind('/') + 1);
    if (figure != name) {
      EXPECT_EQ(known_figures().count(figure), 1U) << figure;
    }
  }
}

TEST(LiveStatistics, KeepTheVersionWhileTheNamesStay) {
  LiveStatistics statistics({}, 5);
  Frame frame = small_frame();
  EXPECT_TRUE(statistics.update({listed(frame)}, 20 * kSecond));
  frame.tasks[0].figures.released = 101;
  EXPECT_FALSE(statistics.update({listed(frame)}, 21 * kSecond));
  EXPECT_EQ(statistics.version(), 5U);
  EXPECT_EQ(value(statistics, "robot/control/pid/released"), 101);

  const std::size_t before = statistics.names().size();
  frame.tasks.push_back({.name = "log", .dag = 0});
  EXPECT_TRUE(statistics.update({listed(frame)}, 22 * kSecond));
  EXPECT_EQ(statistics.version(), 6U);
  EXPECT_GT(statistics.names().size(), before);
  EXPECT_THAT(statistics.names(), Contains("robot/control/log/released"));

  frame.tasks.pop_back();
  EXPECT_TRUE(statistics.update({listed(frame)}, 23 * kSecond));
  EXPECT_EQ(statistics.version(), 7U);
  EXPECT_EQ(statistics.names().size(), before);
  EXPECT_TRUE(statistics.update({}, 24 * kSecond));
  EXPECT_EQ(statistics.version(), 8U);
  EXPECT_THAT(statistics.names(), ElementsAre("executors", "unreadable_pages", "left_out"));
}

TEST(LiveStatistics, ExecutorsOfOneNameKeepTheirs) {
  const auto frame = [](redag::Time began, std::uint64_t released) {
    Frame result = small_frame("robot", began * kSecond);
    result.tasks[0].figures.released = released;
    return result;
  };
  LiveStatistics statistics({"released"}, 1);
  // The one that began first has the plain name, wherever it is listed.
  statistics.update({listed(frame(20, 2), 30), listed(frame(10, 1), 40), listed(frame(25, 3), 30, 1)}, 40 * kSecond);
  EXPECT_EQ(value(statistics, "robot/control/pid/released"), 1);
  EXPECT_EQ(value(statistics, "robot.30/control/pid/released"), 2);
  EXPECT_EQ(value(statistics, "robot.30.1/control/pid/released"), 3);
  // The others keep their names when it ends.
  statistics.update({listed(frame(20, 4), 30), listed(frame(25, 5), 30, 1)}, 41 * kSecond);
  EXPECT_EQ(value(statistics, "robot/control/pid/released"), std::nullopt);
  EXPECT_EQ(value(statistics, "robot.30/control/pid/released"), 4);
  EXPECT_EQ(value(statistics, "robot.30.1/control/pid/released"), 5);
  // A new one may have the plain name again, with the process number of the first one too.
  statistics.update({listed(frame(20, 4), 30), listed(frame(35, 6), 40, 0, 99)}, 42 * kSecond);
  EXPECT_EQ(value(statistics, "robot/control/pid/released"), 6);
}

TEST(LiveStatistics, EachNameStandsThereOnce) {
  Frame frame = small_frame();
  frame.dags.push_back({.name = "threads"});  // as the group of the worker threads
  frame.tasks.push_back({.name = "0", .dag = 2});
  frame.tasks.push_back({.name = "/0/", .dag = 2});
  frame.dags.push_back({.name = ""});
  frame.tasks.push_back({.name = "pid", .dag = 0});
  LiveStatistics statistics({}, 1);
  EXPECT_TRUE(statistics.update({listed(frame)}, 20 * kSecond));
  std::vector<std::string> names = statistics.names();
  std::sort(names.begin(), names.end());
  EXPECT_EQ(std::adjacent_find(names.begin(), names.end()), names.end());
  EXPECT_THAT(names, Contains("robot/control/pid (2)/released"));
  EXPECT_THAT(names, Contains("robot/threads/0 (3)/released"));
  EXPECT_THAT(names, Not(Contains(StartsWith("/"))));
  EXPECT_FALSE(statistics.update({listed(frame)}, 21 * kSecond));
}

TEST(LiveStatistics, CountPagesThatCannotBeRead) {
  LiveStatistics statistics({"misses"}, 1);
  const Listed bad{"/x/redag.1.0", 1, 0, redag::make_error("damaged")};
  statistics.update({bad, listed(small_frame())}, 20 * kSecond);
  EXPECT_EQ(value(statistics, "executors"), 1);
  EXPECT_EQ(value(statistics, "unreadable_pages"), 1);
}

TEST(LiveStatistics, HaveAMostNumberOfValues) {
  LiveStatistics statistics({"released", "misses"}, 1, 10);
  statistics.update({listed(large_frame(20))}, 20 * kSecond);  // 2 DAGs and 20 tasks
  EXPECT_EQ(statistics.names().size(), 13U);
  EXPECT_EQ(value(statistics, "left_out"), 2 * 22 - 10);
  EXPECT_FALSE(statistics.update({listed(large_frame(20))}, 20 * kSecond));

  LiveStatistics all({}, 1);
  all.update({listed(large_frame(1000))}, 20 * kSecond);
  EXPECT_EQ(value(all, "left_out"), 0);
  all.update({listed(large_frame(5000))}, 20 * kSecond);
  EXPECT_EQ(all.values().size(), kMostStatistics + 3);
  EXPECT_GT(value(all, "left_out"), 0);
}

/// Runs publish_statistics with `arguments`. Returns its exit status, and what it wrote.
std::pair<int, std::string> run_program(const std::string &arguments) {
  std::FILE *const pipe = popen((PUBLISHER " " + arguments + " 2>&1").c_str(), "r");
  if (pipe == nullptr) return {-1, "popen failed"};
  std::string text;
  std::array<char, 4096> part{};
  for (std::size_t size = 0; (size = std::fread(part.data(), 1, part.size(), pipe)) > 0;)
    text.append(part.data(), size);
  return {WEXITSTATUS(pclose(pipe)), text};
}

TEST(PublishStatistics, RefusesBadInput) {
  const auto [figure_status, figure] = run_program("--figures misses,nonsense");
  EXPECT_EQ(figure_status, 2);
  EXPECT_THAT(figure, HasSubstr("'nonsense' is not one of aborted, active, "));
  const auto [folder_status, folder] = run_program("--folder /nowhere/at/all");
  EXPECT_EQ(folder_status, 2);
  EXPECT_THAT(folder, HasSubstr("'/nowhere/at/all' is not a folder"));
  EXPECT_EQ(run_program("--period 0ms").first, 2);
  const auto [help_status, help] = run_program("--help");
  EXPECT_EQ(help_status, 0);
  EXPECT_THAT(help, HasSubstr("--figures"));
}

#ifndef REDAG_PAL_STATISTICS
TEST(PublishStatistics, SaysThatItsMessagesAreMissing) {
  const auto [status, text] = run_program("");
  EXPECT_EQ(status, 2);
  EXPECT_THAT(text, HasSubstr("was built without pal_statistics_msgs"));
}
#endif

}  // namespace
}  // namespace redag_rclcpp::lab
