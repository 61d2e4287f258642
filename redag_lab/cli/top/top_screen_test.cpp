// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/cli/top/top_screen.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <fstream>
#include <sstream>

#include "redag_lab/cli/top/frame_for_tests.hpp"
#include "tests/testing/repository.hpp"

namespace redag::cli {
namespace {

using testing::accelerated_page;
using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::Not;
using testing::robot_page;
using ::testing::SizeIs;
using testing::small_page;
using ::testing::StartsWith;

const Glyphs kBlocks{};
const Glyphs kAscii{.ascii = true};

struct Shot {
  std::vector<std::string> lines;
  TopDrawing drawing;
};

Shot shoot(const TopState &state, const live::Listed *shown, std::size_t columns, std::size_t lines,
           const Course *course = nullptr, Time now = 0) {
  const std::vector<live::Listed> pages = shown == nullptr ? std::vector<live::Listed>{} : std::vector{*shown};
  if (now == 0 && shown != nullptr) now = shown->page->frame.published;
  const TopInput input{.pages = pages, .shown = shown, .now = now, .course = course};
  Shot shot{{}, draw_top(state, input, columns, lines, kBlocks)};
  for (const Line &line : shot.drawing.lines) {
    shot.lines.push_back(plain(line));
    EXPECT_LE(width_of(line), columns) << plain(line);
  }
  EXPECT_THAT(shot.lines, SizeIs(lines));
  return shot;
}

std::string joined(const std::vector<std::string> &lines) {
  std::string text;
  for (const std::string &line : lines) text += line + "\n";
  return text;
}

/// Compares with redag_lab/cli/top/screens/`name`.txt. REDAG_UPDATE_SCREENS=1 writes the files anew.
void expect_screen(const std::string &name, const std::vector<std::string> &lines) {
  const std::string path = redag::testing::repository() / "redag_lab/cli/top/screens" / (name + ".txt");
  if (std::getenv("REDAG_UPDATE_SCREENS") != nullptr) std::ofstream(path) << joined(lines);
  std::stringstream expected;
  expected << std::ifstream(path).rdbuf();
  EXPECT_EQ(joined(lines), expected.str()) << "REDAG_UPDATE_SCREENS=1 writes " << path << "; look at it";
}

Course course_of(const live::Listed &listed) {
  Course course;
  live::Frame frame = listed.page->frame;
  for (int look = 1; look <= 40; ++look) {
    frame.sequence = static_cast<std::uint64_t>(look);
    for (live::TaskFrame &task : frame.tasks) {
      task.figures.recent_p99 = task.deadline * ((look * 7 + static_cast<int>(task.dag)) % 20 + 2) / 20;
    }
    course.add(frame);
  }
  return course;
}

TEST(TopScreen, AsItWasAt80x24) {
  const live::Listed robot = robot_page();
  const Course course = course_of(robot);
  expect_screen("80x24", shoot({}, &robot, 80, 24, &course).lines);
}

TEST(TopScreen, AsItWasAt120x40) {
  const live::Listed robot = robot_page();
  const Course course = course_of(robot);
  TopState state;
  state.view.order = LiveOrder::Misses;
  state.cursor = 2;
  expect_screen("120x40", shoot(state, &robot, 120, 40, &course).lines);
}

TEST(TopScreen, AsItWasAt200x50) {
  const live::Listed robot = robot_page();
  const Course course = course_of(robot);
  TopState state;
  state.view.since_start = true;
  state.view.filter = "li";
  expect_screen("200x50", shoot(state, &robot, 200, 50, &course).lines);
}

TEST(TopScreen, DevicesAt80x24) {
  const live::Listed robot = accelerated_page();
  const Course course = course_of(robot);
  expect_screen("devices_80x24", shoot({}, &robot, 80, 24, &course).lines);
}

TEST(TopScreen, DevicesAt160x50) {
  const live::Listed robot = accelerated_page();
  const Course course = course_of(robot);
  TopState state;
  state.view.since_start = true;
  expect_screen("devices_160x50", shoot(state, &robot, 160, 50, &course).lines);
}

TEST(TopScreen, OfTooManyDevicesSomeAreCounted) {
  live::Listed robot = accelerated_page();
  live::Frame &frame = robot.page->frame;
  while (frame.devices.size() < live::page::kDevices) frame.devices.push_back({.name = "npu"});
  frame.devices_in_all = 20;
  const std::string text = joined(shoot({}, &robot, 80, 24).lines);
  EXPECT_THAT(text, HasSubstr("\n18 more devices\n"));
  EXPECT_THAT(text, HasSubstr("encoder"));
  std::string once;
  for (const Line &line : draw_once(robot, {}, frame.published, 80, kBlocks)) once += plain(line) + "\n";
  EXPECT_THAT(once, HasSubstr("\n8 more devices\n"));
}

TEST(TopScreen, HelpAt80x24) {
  TopState state;
  state.mode = TopMode::Help;
  const live::Listed robot = robot_page();
  expect_screen("help_80x24", shoot(state, &robot, 80, 24).lines);
}

TEST(TopScreen, TheListMarksAnExecutor) {
  TopState state;
  state.mode = TopMode::Choose;
  state.chosen = 1;
  live::Listed refused = small_page(14, "arm");
  refused.page = make_error("/x/redag.14.0 is not read, because it belongs to user 1000");
  const std::vector<live::Listed> pages{small_page(), robot_page(), refused};
  const TopInput input{.pages = pages, .now = 3'700 * kSecond};
  std::vector<std::string> lines;
  const TopDrawing drawing = draw_top(state, input, 80, 24, kBlocks);
  for (const Line &line : drawing.lines) lines.push_back(plain(line));
  EXPECT_THAT(lines[2], StartsWith("  1    12  cart"));
  EXPECT_THAT(lines[3], StartsWith("> 2 20817  robot"));
  EXPECT_THAT(lines[4], StartsWith("  3    14  ?"));
  EXPECT_TRUE(drawing.lines[3].front().reversed);
  EXPECT_EQ(drawing.places.executors, 3U);
  EXPECT_EQ(drawing.places.executors_line, 2U);
}

TEST(TopScreen, NamesOfAllTasksAreWholeAt80x24) {
  const live::Listed robot = robot_page();
  for (const LiveOrder order : {LiveOrder::Dag, LiveOrder::Name, LiveOrder::P99}) {
    TopState state;
    state.view.order = order;
    for (std::size_t cursor = 0; cursor < 40; ++cursor) {
      state.cursor = cursor;
      const Shot shot = shoot(state, &robot, 80, 24);
      for (std::size_t i = shot.drawing.places.titles_line; i < 24; ++i) {
        EXPECT_THAT(shot.lines[i], Not(HasSubstr("\u2026")));
      }
    }
  }
}

TEST(TopScreen, FitsEachSize) {
  const live::Listed robot = accelerated_page();
  const Course course = course_of(robot);
  for (const TopMode mode : {TopMode::Table, TopMode::Choose, TopMode::Help, TopMode::Filter, TopMode::Search}) {
    TopState state;
    state.mode = mode;
    state.cursor = 39;
    for (const std::size_t columns : {1U, 2U, 3U, 7U, 12U, 20U, 37U, 40U, 72U, 80U, 81U, 133U, 300U}) {
      for (const std::size_t lines : {1U, 2U, 3U, 5U, 9U, 24U, 100U})
        (void)shoot(state, &robot, columns, lines, &course);
    }
  }
  (void)shoot({}, nullptr, 80, 24);
}

TEST(TopScreen, SaysHowManyRowsAreOutOfSight) {
  const live::Listed robot = robot_page();
  TopState state;
  const Shot top = shoot(state, &robot, 80, 24);
  const std::size_t page = top.drawing.places.page;
  EXPECT_THAT(top.drawing.places.names, SizeIs(40));
  EXPECT_EQ(top.lines[22], std::to_string(40 - page) + " more below");
  state.cursor = page;  // the first row out of sight
  const Shot next = shoot(state, &robot, 80, 24);
  EXPECT_EQ(next.drawing.first, 1U);
  EXPECT_EQ(next.lines[22], "1 more above, " + std::to_string(40 - page - 1) + " more below");
  state.cursor = 39;
  const Shot end = shoot(state, &robot, 80, 24);
  EXPECT_EQ(end.lines[22], std::to_string(40 - page) + " more above");
  // The mark moves within the screen before the rows do.
  state.first = end.drawing.first;
  state.cursor = 38;
  EXPECT_EQ(shoot(state, &robot, 80, 24).drawing.first, end.drawing.first);
  EXPECT_THAT(shoot({}, &robot, 80, 100).lines, Not(Contains(HasSubstr("more below"))));
}

TEST(TopScreen, TheMarkedRowIsReversed) {
  const live::Listed small = small_page();
  TopState state;
  state.cursor = 2;
  const Shot shot = shoot(state, &small, 80, 24);
  const std::size_t line = shot.drawing.places.rows_line + 2;
  EXPECT_THAT(shot.lines[line], StartsWith("  act"));
  for (std::size_t i = 0; i < shot.drawing.lines.size(); ++i) {
    bool all = !shot.drawing.lines[i].empty();
    for (const Span &span : shot.drawing.lines[i]) all = all && span.reversed;
    EXPECT_EQ(all, i == line) << i;
  }
}

TEST(TopScreen, TitlesStandWhereTheirColumnsAre) {
  const live::Listed robot = robot_page();
  TopState state;
  state.view.order = LiveOrder::P99;
  const Shot shot = shoot(state, &robot, 120, 40);
  const std::string &titles = shot.lines[shot.drawing.places.titles_line];
  std::size_t found = 0;
  for (const TitlePlace &place : shot.drawing.places.titles) {
    if (place.order == LiveOrder::P99) {
      EXPECT_EQ(titles.substr(place.end - 3, 3), "p99");
      ++found;
    }
    if (place.order == LiveOrder::Name) {
      EXPECT_EQ(titles.substr(place.begin, 4), "task");
      ++found;
    }
  }
  EXPECT_EQ(found, 2U);
  for (const Span &span : shot.drawing.lines[shot.drawing.places.titles_line]) {
    EXPECT_EQ(span.reversed,
              span.text.find("p99") != std::string::npos && span.text.find("lately") == std::string::npos);
  }
}

TEST(TopScreen, SaysWhatIsTheMatter) {
  live::Listed small = small_page();
  EXPECT_THAT(joined(shoot({}, &small, 80, 24, nullptr, 25 * kSecond).lines), HasSubstr("no update for 5s"));
  small.page->frame.alert = "deadlock: a waits for b";
  small.page->frame.left_out = 3;
  TopState state;
  state.paused = true;
  state.view.filter = "nothing";
  const std::string text = joined(shoot(state, &small, 80, 24).lines);
  EXPECT_THAT(text, HasSubstr("deadlock: a waits for b"));
  EXPECT_THAT(text, HasSubstr("3 more tasks do not fit"));
  EXPECT_THAT(text, HasSubstr("paused"));
  EXPECT_THAT(text, HasSubstr("filter: nothing"));
  EXPECT_THAT(text, HasSubstr("no name contains"));
  const std::vector<live::Listed> pages{small};
  const TopInput gone{.pages = pages, .shown = &small, .is_gone = true, .now = 100 * kSecond};
  std::string lines;
  for (const Line &line : draw_top({}, gone, 80, 24, kBlocks).lines) lines += plain(line) + "\n";
  EXPECT_THAT(lines, HasSubstr("has ended"));
  EXPECT_THAT(lines, Not(HasSubstr("no update")));
  EXPECT_THAT(joined(shoot({}, nullptr, 80, 24).lines), HasSubstr("waiting for one"));
}

TEST(TopScreen, WhatIsTypedIsOnTheLastLine) {
  const live::Listed small = small_page();
  TopState state;
  state.mode = TopMode::Filter;
  state.typed = "pl";
  EXPECT_EQ(shoot(state, &small, 80, 24).lines.back(), "filter: pl_");
  state.mode = TopMode::Search;
  EXPECT_EQ(shoot(state, &small, 80, 24).lines.back(), "search: pl_");
}

TEST(TopScreen, OfManyThreadsTheBusiestAreShown) {
  live::Listed robot = robot_page();
  live::Frame &frame = robot.page->frame;
  frame.threads.clear();
  for (std::uint32_t i = 0; i < 20; ++i) frame.threads.push_back({.index = i, .recent_used = i * kMillisecond});
  frame.threads_in_all = 100;
  const std::string text = joined(shoot({}, &robot, 80, 24).lines);
  EXPECT_THAT(text, HasSubstr("93 more threads"));
  EXPECT_THAT(text, HasSubstr("\n13 ["));
  EXPECT_THAT(text, Not(HasSubstr("\n12 [")));
}

TEST(TopOnce, WhatIsCutIsMarkedInAscii) {
  const live::Listed robot = robot_page();
  bool is_cut = false;
  for (const Line &line : draw_once(robot, {}, robot.page->frame.published, 30, kAscii)) {
    const std::string text = plain(line);
    is_cut = is_cut || text.ends_with("~");
    for (const char c : text) EXPECT_LT(static_cast<unsigned char>(c), 0x80) << text;
  }
  EXPECT_TRUE(is_cut);
}

TEST(TopOnce, AllRowsAndColumnsWithoutALimit) {
  const live::Listed robot = robot_page();
  std::vector<std::string> lines;
  for (const Line &line : draw_once(robot, {}, robot.page->frame.published, 0, kAscii)) lines.push_back(plain(line));
  EXPECT_THAT(lines, Contains(HasSubstr("lidar_front")));
  EXPECT_THAT(lines, Contains(StartsWith("task")));
  for (const char *column : {"rate/s", "p50", "p99", "max", "deadline", "bound", "missed", "active", "away", "ready",
                             "wait", "preempted", "cpu"}) {
    EXPECT_THAT(lines, Contains(HasSubstr(column)));
  }
  EXPECT_THAT(lines, SizeIs(3 + 2 + 1 + 40));
  for (std::size_t i = 5; i < lines.size(); ++i) {
    for (const char c : lines[i]) EXPECT_LT(static_cast<unsigned char>(c), 0x80) << lines[i];
  }
}

TEST(TopOnce, NamesWhatFoundNoRoom) {
  const live::Listed small = small_page();
  std::vector<std::string> lines;
  for (const Line &line : draw_once(small, {}, small.page->frame.published, 40, kBlocks)) lines.push_back(plain(line));
  EXPECT_THAT(lines.back(), StartsWith("(no room for: "));
  EXPECT_THAT(lines, Contains(StartsWith("  sense")));
}

TEST(Styled, LinesAreCutAtTheirEndAndNamesInTheMiddle) {
  const Line line{{"abc", Tint::Bad}, {"def", Tint::Good}};
  EXPECT_EQ(plain(cut(line, 6)), "abcdef");
  EXPECT_EQ(plain(cut(line, 5)), "abcd\u2026");
  EXPECT_EQ(plain(cut(line, 3)), "ab\u2026");
  EXPECT_EQ(plain(cut(line, 1)), "\u2026");
  EXPECT_EQ(with_codes({{"abc", Tint::Bad}}, true), "\033[31mabc\033[0m");
  EXPECT_EQ(cut_middle("lidar_front_left", 16), "lidar_front_left");
  EXPECT_EQ(cut_middle("lidar_front_left", 11), "lidar\u2026_left");
  EXPECT_EQ(cut_middle("\u00e4\u00f6\u00fcabc", 5), "\u00e4\u00f6\u2026bc");
}

}  // namespace
}  // namespace redag::cli
