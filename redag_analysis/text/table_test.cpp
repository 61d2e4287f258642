// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/text/table.hpp"

#include <gtest/gtest.h>

#include <sstream>

namespace redag {
namespace {

Table three_columns() {
  Table table({{"task", false, 9}, {"jobs", true, 1}, {"max", true, 5}});
  table.add({{"control.imu"}, {"5 000"}, {"1ms"}});
  table.add({{"p"}, {"7"}, {"12.5ms", Tint::Bad}});
  return table;
}

std::size_t widest_line(const std::string &text) {
  std::istringstream lines(text);
  std::size_t widest = 0;
  for (std::string line; std::getline(lines, line);) {
    if (line.front() != '(') widest = std::max(widest, display_width(line));
  }
  return widest;
}

TEST(Table, AlignsTextLeftAndNumbersRight) {
  EXPECT_EQ(three_columns().render(0, false),
            "task          jobs     max\n"
            "control.imu  5 000     1ms\n"
            "p                7  12.5ms\n");
}

TEST(Table, ColoursCellsWithoutMovingThem) {
  const std::string text = three_columns().render(0, true);
  EXPECT_NE(text.find("  \033[31m12.5ms\033[0m"), std::string::npos) << text;
}

TEST(Table, CutsTextBeforeItDropsColumns) {
  EXPECT_EQ(three_columns().render(24, false),
            "task        jobs     max\n"
            "control.…  5 000     1ms\n"
            "p              7  12.5ms\n");
}

TEST(Table, DropsTheLeastImportantColumnsAndSaysSo) {
  const std::string text = three_columns().render(17, false);
  EXPECT_LE(widest_line(text), 17U) << text;
  EXPECT_NE(text.find("(no room for: jobs)"), std::string::npos) << text;
  EXPECT_NE(text.find("12.5ms"), std::string::npos) << text;
}

TEST(Table, OfEquallyImportantColumnsTheLastGoes) {
  Table table({{"aaaaaaaa", true, 1}, {"bbbbbbbb", true, 1}});
  table.add({{"1"}, {"2"}});
  EXPECT_EQ(table.render(10, false), "aaaaaaaa\n       1\n(no room for: bbbbbbbb)\n");
}

TEST(Table, KeepsTheLastColumnOnTheNarrowestTerminal) {
  const std::string text = three_columns().render(1, false);
  EXPECT_NE(text.find("task"), std::string::npos) << text;
}

TEST(Table, CountsCharactersNotBytes) {
  EXPECT_EQ(display_width("µs"), 2U);
  EXPECT_EQ(cut("größere", 4), "grö…");
  EXPECT_EQ(cut("größe", 5), "größe");
  EXPECT_EQ(cut("abc", 0), "");
}

TEST(Table, NamesAreNotCutUntilTheyAreTheSame) {
  Table table({{"task", false, 9}, {"jobs", true, 5}, {"late", true, 1}});
  table.add({{"perception.camera"}, {"1 000 000"}, {"1 000 000"}});
  table.add({{"perception.lidar"}, {"1 000 000"}, {"1 000 000"}});
  const std::string text = table.render(30, false);
  EXPECT_NE(text.find("perception.c…"), std::string::npos) << text;
  EXPECT_NE(text.find("perception.l…"), std::string::npos) << text;
  EXPECT_NE(text.find("(no room for: late)"), std::string::npos) << text;
}

}  // namespace
}  // namespace redag
