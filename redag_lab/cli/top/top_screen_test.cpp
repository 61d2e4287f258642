// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/cli/top/top_screen.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <fstream>
#include <sstream>

#include "tests/testing/live_frame.hpp"
#include "tests/testing/repository.hpp"

namespace redag::cli {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::SizeIs;
using testing::small_page;
using ::testing::StartsWith;

using Lines = std::vector<std::string>;

/// A robot: ten DAGs of three tasks with names as in ROS 2, four worker threads, some misses.
live::Listed robot_page() {
  live::Frame frame;
  frame.name = "robot";
  frame.program = "component_container";
  frame.driver = "ros";
  frame.preemption = "os";
  frame.policy = "rate_monotonic";
  frame.workers = 4;
  frame.began = 100 * kSecond;
  frame.published = 3'700 * kSecond;
  frame.interval = kSecond / 2;
  frame.window = 2'500 * kMillisecond;
  frame.publisher_cpu = 600 * kMillisecond;
  const char *const dags[] = {"control",      "imu_filter",           "wheel_odometry", "lidar_front", "lidar_rear",
                              "localization", "local_costmap_update", "planner",        "diagnostics", "map_server"};
  const char *const tasks[] = {"receive", "compute_and_fuse", "publish"};
  for (std::uint32_t d = 0; d < 10; ++d) {
    const Duration period = (d + 1) * 4 * kMillisecond;
    live::DagFrame dag{.name = dags[d], .max_active = d % 3 == 0 ? 2U : 0U, .deadline = d % 2 == 0 ? period : 0};
    for (std::uint32_t t = 0; t < 3; ++t) {
      live::TaskFrame task{.name = tasks[t], .dag = d, .period = period, .deadline = period};
      task.bound = d < 4 ? period / 2 : 0;
      const Duration typical = (t + 1) * period / 16;
      live::page::Figures &figures = task.figures;
      figures.released = figures.finished = static_cast<std::uint64_t>(3'600 * kSecond / period);
      figures.recent_jobs = static_cast<std::uint64_t>(frame.window / period);
      figures.recent_cpu = static_cast<Duration>(figures.recent_jobs) * typical / 2;
      figures.recent_p50 = typical;
      figures.recent_p99 = typical * 2;
      figures.recent_max = typical * 3;
      figures.response_max = typical * 7;
      figures.active = (d + t) % 4 == 0 ? 1 : 0;
      figures.ready = (d + t) % 5 == 0 ? 1 : 0;
      if (d == 3 && t == 2) figures.misses = 4'231;
      if (d == 6 && t == 1) {
        figures.misses = 17;
        figures.recent_misses = 2;
        figures.recent_max = figures.recent_p99 = figures.response_max = 31 * kMillisecond;
      }
      dag.figures.released += figures.released;
      dag.figures.finished += figures.finished;
      dag.figures.misses += figures.misses;
      dag.figures.recent_jobs += figures.recent_jobs;
      dag.figures.recent_misses += figures.recent_misses;
      dag.figures.recent_cpu += figures.recent_cpu;
      dag.figures.active += figures.active;
      dag.figures.ready += figures.ready;
      dag.figures.recent_p50 = 2 * typical;
      dag.figures.recent_p99 = 3 * typical;
      dag.figures.recent_max = 4 * typical;
      dag.figures.response_max = 8 * typical;
      frame.tasks.push_back(std::move(task));
    }
    frame.dags.push_back(std::move(dag));
  }
  return testing::listed(std::move(frame), 20'817);
}

/// The robot with accelerators, for which some jobs wait.
live::Listed accelerated_page() {
  live::Listed robot = robot_page();
  live::Frame &frame = robot.page->frame;
  frame.devices_in_all = 2;
  frame.devices = {{.name = "gpu",
                    .slots = 1,
                    .used = 1,
                    .queued = 2,
                    .recent_served = 249,
                    .recent_busy = 2'010 * kMillisecond,
                    .tasks = {10}},
                   {.name = "encoder",
                    .slots = 6,
                    .used = 5,
                    .recent_served = 61,
                    .recent_busy = 4'800 * kMillisecond,
                    .tasks = {13, 16, 19, 22}}};
  for (const std::uint32_t task : {10U, 13U, 16U, 19U, 22U, 25U}) {
    live::DagFrame &dag = frame.dags[frame.tasks[task].dag];
    for (live::page::Figures *figures : {&frame.tasks[task].figures, &dag.figures}) {
      figures->active += 1;
      figures->away += 1;
    }
  }
  return robot;
}

Lines shoot(TopState &state, const live::Listed *shown, std::size_t columns, std::size_t lines, bool colour = false) {
  const std::vector<live::Listed> pages = shown == nullptr ? std::vector<live::Listed>{} : std::vector{*shown};
  const TopInput input{.pages = pages, .shown = shown, .now = shown == nullptr ? 0 : shown->page->frame.published};
  Lines screen = draw_top(state, input, columns, lines, colour);
  EXPECT_THAT(screen, SizeIs(lines));
  for (std::string &line : screen) {
    EXPECT_LE(display_width(line), columns) << line;
    line.erase(line.find_last_not_of(' ') + 1);
  }
  return screen;
}

Lines shoot(const live::Listed *shown, std::size_t columns, std::size_t lines) {
  TopState state;
  return shoot(state, shown, columns, lines);
}

std::string joined(const Lines &lines) {
  std::string text;
  for (const std::string &line : lines) text += line + "\n";
  return text;
}

/// Compares with redag_lab/cli/top/screens/`name`.txt. REDAG_UPDATE_SCREENS=1 writes the files anew.
void expect_screen(const std::string &name, const Lines &lines) {
  const std::string path = redag::testing::repository() / "redag_lab/cli/top/screens" / (name + ".txt");
  if (std::getenv("REDAG_UPDATE_SCREENS") != nullptr) std::ofstream(path) << joined(lines);
  std::stringstream expected;
  expected << std::ifstream(path).rdbuf();
  EXPECT_EQ(joined(lines), expected.str()) << "REDAG_UPDATE_SCREENS=1 writes " << path << "; look at it";
}

TEST(TopScreen, AsItWasAt80x24) {
  const live::Listed robot = robot_page();
  expect_screen("80x24", shoot(&robot, 80, 24));
}

TEST(TopScreen, AsItWasAt120x40) {
  const live::Listed robot = accelerated_page();
  TopState state;
  state.view.order = LiveOrder::Misses;
  expect_screen("120x40", shoot(state, &robot, 120, 40));
}

TEST(TopScreen, HelpAt80x24) {
  TopState state;
  state.mode = TopMode::Help;
  expect_screen("help_80x24", shoot(state, nullptr, 80, 24));
}

TEST(TopScreen, OfAllExecutorsNamesThem) {
  std::vector<live::Listed> pages{small_page(), small_page(13, "arm")};
  pages[1].page->frame.tasks[0].priority = 79;
  const TopInput input{.pages = pages, .shown = pages.data(), .now = 20 * kSecond};
  TopState state{.view = {.all = true}};
  const Lines lines = draw_top(state, input, 140, 24, false);
  EXPECT_THAT(lines[0], StartsWith("sorted by urgency"));
  EXPECT_THAT(lines[2], ::testing::MatchesRegex("   79 +10ms +13 +arm +fast\\.sense +.*"));
  EXPECT_THAT(lines[3], ::testing::MatchesRegex("    - +10ms +12 +cart +fast\\.sense +.*"));
}

TEST(TopScreen, NamesOfAllTasksAreWholeAt80x24) {
  const live::Listed robot = robot_page();
  for (const LiveOrder order : {LiveOrder::Dag, LiveOrder::Rate, LiveOrder::Longest}) {
    TopState state;
    state.view.order = order;
    for (std::size_t first = 0; first < 20; ++first) {
      state.first = first;
      const Lines lines = shoot(state, &robot, 80, 24);
      for (std::size_t i = 4; i < 23; ++i) EXPECT_THAT(lines[i], Not(HasSubstr("~")));
    }
  }
}

TEST(TopScreen, FitsEachSize) {
  const live::Listed robot = accelerated_page();
  for (const TopMode mode : {TopMode::Table, TopMode::Help}) {
    TopState state;
    state.mode = mode;
    for (const std::size_t columns : {1U, 2U, 3U, 7U, 12U, 20U, 37U, 40U, 72U, 80U, 81U, 133U, 300U}) {
      for (const std::size_t lines : {1U, 2U, 3U, 5U, 9U, 24U, 100U}) {
        state.first = 39;
        (void)shoot(state, &robot, columns, lines);
        (void)shoot(state, &robot, columns, lines, true);
      }
    }
  }
  (void)shoot(nullptr, 80, 24);
}

TEST(TopScreen, SaysWhichRowsAreInSight) {
  const live::Listed robot = robot_page();
  TopState state;
  EXPECT_THAT(shoot(state, &robot, 80, 24).back(), StartsWith("1-18 of 40  ? help"));
  EXPECT_EQ(state.page, 18U);
  state.first = 1'000'000;
  const Lines end = shoot(state, &robot, 80, 24);
  EXPECT_EQ(state.first, 22U);
  EXPECT_THAT(end.back(), StartsWith("23-40 of 40  "));
  EXPECT_THAT(end[22], StartsWith("  publish"));
  EXPECT_THAT(shoot(state, &robot, 80, 100).back(), StartsWith("? help"));
}

TEST(TopScreen, SaysWhatIsTheMatter) {
  live::Listed small = small_page();
  TopState state{.paused = true};
  const std::vector<live::Listed> pages{small};
  EXPECT_THAT(joined(draw_top(state, {.pages = pages, .shown = &small, .now = 25 * kSecond}, 80, 24, false)),
              HasSubstr("no update for 5s"));
  small.page->frame.alert = "deadlock: a waits for b";
  small.page->frame.left_out = 3;
  const std::string text = joined(shoot(state, &small, 80, 24));
  EXPECT_THAT(text, HasSubstr("deadlock: a waits for b"));
  EXPECT_THAT(text, HasSubstr("3 more tasks do not fit"));
  EXPECT_THAT(text, HasSubstr("paused"));
  const TopInput gone{.pages = pages, .shown = &small, .is_gone = true, .now = 100 * kSecond};
  const std::string ended = joined(draw_top(state, gone, 80, 24, false));
  EXPECT_THAT(ended, HasSubstr("has ended"));
  EXPECT_THAT(ended, Not(HasSubstr("no update")));
  EXPECT_THAT(joined(shoot(nullptr, 80, 24)), HasSubstr("waiting for one"));
}

TEST(TopOnce, WhatIsCutIsMarked) {
  const live::Listed robot = robot_page();
  const std::string text = draw_once(robot, {}, robot.page->frame.published, 30, false);
  EXPECT_THAT(text, HasSubstr("~\n"));
  for (const char c : text) EXPECT_LT(static_cast<unsigned char>(c), 0x80) << text;
}

TEST(TopOnce, AllRowsAndColumnsWithoutALimit) {
  const live::Listed robot = accelerated_page();
  const std::string text = draw_once(robot, {}, robot.page->frame.published, 0, false);
  for (const char *word : {"lidar_front", "\ntask ", "rate/s", "p50", "p99", "max", "worst", "deadline", "bound",
                           "missed", "active", "away", "ready", "cpu", "\ngpu ", "80.4 %", "encoder"}) {
    EXPECT_THAT(text, HasSubstr(word));
  }
  EXPECT_EQ(std::count(text.begin(), text.end(), '\n'), 3 + 1 + 1 + 40);
}

TEST(TopOnce, NamesWhatFoundNoRoom) {
  const live::Listed small = small_page();
  const std::string text = draw_once(small, {}, small.page->frame.published, 40, false);
  EXPECT_THAT(text, HasSubstr("\n(no room for: "));
  EXPECT_THAT(text, HasSubstr("\n  sense "));
}

}  // namespace
}  // namespace redag::cli
