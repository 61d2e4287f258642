// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/text/table.hpp"

#include <gtest/gtest.h>

#include <sstream>

#include "redag_analysis/text/wrap.hpp"

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

TEST(Table, DropsNumbersBeforeItCutsNamesAndSaysSo) {
  EXPECT_EQ(three_columns().render(24, false),
            "task            max\n"
            "control.imu     1ms\n"
            "p            12.5ms\n"
            "(no room for: jobs)\n");
}

TEST(Table, TheMostImportantNumberStaysBesideCutNames) {
  EXPECT_EQ(three_columns().render(17, false),
            "task          max\n"
            "control.~     1ms\n"
            "p          12.5ms\n"
            "(no room for:\n"
            "  jobs)\n");
}

TEST(Table, OfEquallyImportantColumnsTheLastGoes) {
  Table table({{"aaaaaaaa", true, 1}, {"bbbbbbbb", true, 1}});
  table.add({{"1"}, {"2"}});
  EXPECT_EQ(table.render(10, false), "aaaaaaaa\n       1\n(no room\n  for:\n  bbbbbbbb)\n");
}

TEST(Table, KeepsTheLastColumnOnTheNarrowestTerminal) {
  for (const std::size_t width : {1U, 4U}) {
    const std::string text = three_columns().render(width, false);
    EXPECT_EQ(text.find(width == 1 ? "~" : "task"), 0U) << text;
  }
}

TEST(Table, CountsCharactersNotBytes) {
  EXPECT_EQ(display_width("µs"), 2U);
  EXPECT_EQ(cut("größere", 4), "grö~");
  EXPECT_EQ(cut("größe", 5), "größe");
  EXPECT_EQ(cut("abc", 0), "");
  EXPECT_EQ(cut("\033[31mabcd\033[0m", 3), "\033[31mab~\033[0m");
}

TEST(Table, ProseWrapsAtWordsBeforeANumberGoes) {
  Table table({{"method", false, 9}, {"time", true, 1}, {.title = "why", .importance = 1, .prose = true}});
  table.add({{"rta"}, {"1ms"}, {"applies to one worker without preemption, and not to groups"}});
  table.add({{"graham"}, {"12ms"}, {"loose"}});
  EXPECT_EQ(table.render(50, false),
            "method  time  why\n"
            "rta      1ms  applies to one worker without\n"
            "              preemption, and not to groups\n"
            "graham  12ms  loose\n");
}

// At every width from 60 to 200 columns all lines fit, and no name is cut as long as one number could go.
TEST(Table, FitsAtEveryWidth) {
  Table table({{"task", false, 9},
               {"jobs", true, 7},
               {"missed", true, 8},
               {"p50", true, 3},
               {"max", true, 6},
               {.title = "limited by", .importance = 1, .prose = true}});
  const std::string name = "perception.camera_front_left_rectified";
  table.add(
      {{name}, {"1 000 000"}, {"12 (0.0012 %)"}, {"1.234ms"}, {"12.34ms"}, {"the deadline of the sink of its DAG"}});
  for (std::size_t width = 60; width <= 200; ++width) {
    const std::string text = table.render(width, false);
    EXPECT_LE(widest_line(text), width) << text;
    if (width >= 80) {
      EXPECT_NE(text.find(name), std::string::npos) << text;
    }
  }
}

TEST(Wrap, LinesOfADocumentBreakAtWordsWithAHangingIndent) {
  EXPECT_EQ(fitted("short\n  one two three four\nlast", 12), "short\n  one two\n    three\n    four\nlast");
  EXPECT_EQ(fitted("one two three", 0), "one two three");
  EXPECT_EQ(fitted("unbreakable-word is long\n", 8), "unbreakable-word\n  is\n  long\n");
  EXPECT_EQ(fitted("", 8), "");
}

TEST(Wrap, CodesOfColoursTakeNoColumns) {
  const std::string text = tinted("one two", Tint::Bad, true);
  EXPECT_EQ(display_width(text), 7U);
  EXPECT_EQ(fitted(text, 7), text);
}

TEST(Wrap, ASecondLineBeginsWhereTheFirstDid) {
  EXPECT_EQ(wrapped("one two three", 4, 11), "one two\n    three\n");
  EXPECT_EQ(wrapped("one two", 9, 4), "one\n         two\n");
}

}  // namespace
}  // namespace redag
