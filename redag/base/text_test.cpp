// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/base/text.hpp"

#include <gtest/gtest.h>

#include <limits>
#include <string>

namespace redag {
namespace {

TEST(Text, CountsAreGrouped) {
  EXPECT_EQ(format_count(0), "0");
  EXPECT_EQ(format_count(999), "999");
  EXPECT_EQ(format_count(1000), "1 000");
  EXPECT_EQ(format_count(1234567), "1 234 567");
}

TEST(Text, AMissNeverReadsAsNone) {
  EXPECT_EQ(format_percent(0), "0.0 %");
  EXPECT_EQ(format_percent(0.1421), "14.2 %");
  EXPECT_EQ(format_percent(1), "100.0 %");
  EXPECT_EQ(format_percent(3e-5), "0.003 %") << "a miss must not read as none";
  EXPECT_EQ(format_percent(std::numeric_limits<double>::quiet_NaN()), "-");
}

TEST(Text, TheDepthOfJson) {
  EXPECT_FALSE(json_is_too_large("", 0));
  EXPECT_FALSE(json_is_too_large("[1, 2], [3]", 1));
  EXPECT_TRUE(json_is_too_large(R"({"a": [1]})", 1));
  EXPECT_FALSE(json_is_too_large(R"({"a": [1]})", 2));
  EXPECT_FALSE(json_is_too_large(R"(["[[[\"[[", "\\"])", 1)) << "brackets in texts are text";
  EXPECT_TRUE(json_is_too_large(std::string(1'000'000, '[')));
  EXPECT_FALSE(json_is_too_large("]]]]"));
  EXPECT_FALSE(json_is_too_large(R"({"a": [1, "2,3,4"]})", 2, 3));
  EXPECT_TRUE(json_is_too_large(R"({"a": [1, "2,3,4", 5]})", 2, 3));
}

TEST(Text, WhatATerminalWouldObeyIsWrittenOut) {
  EXPECT_EQ(printable("naïve \tλ\n"), "naïve \tλ\n");
  EXPECT_EQ(printable("\x1b[2J"), "\\u{1B}[2J");
  EXPECT_EQ(printable("\xC2\x9B"
                      "2J"),
            "\\u{9B}2J")
      << "C1: the other way to begin a sequence";
  EXPECT_EQ(printable("a\x7f\rb"), "a\\u{7F}\\u{D}b");
  EXPECT_EQ(printable("\xE2\x80\xAE"
                      "exe"),
            "\\u{202E}exe")
      << "text that runs backwards";
  EXPECT_EQ(printable("\xff"), "\\xFF");
  EXPECT_EQ(find_unprintable("imu_42 µ λ"), "");
  EXPECT_EQ(find_unprintable("a\nb"), "U+000A");
  EXPECT_EQ(find_unprintable("a\xC2\x85"), "U+0085");
  EXPECT_EQ(find_unprintable("a\xff"), "byte 0xFF");
}

TEST(Text, QuotesAreShortAndPrintable) {
  EXPECT_EQ(in_quotes("5"), "'5'");
  EXPECT_EQ(in_quotes("a\nb\tc"), "'a\\u{A}b\\u{9}c'") << "on one line";
  EXPECT_EQ(in_quotes("\x1b[2J"), "'\\u{1B}[2J'");
  EXPECT_EQ(in_quotes(std::string(1'000'000, 'x')), "'" + std::string(60, 'x') + "...'");
  EXPECT_EQ(in_quotes(std::string(59, 'x') + "λλ"), "'" + std::string(59, 'x') + "...'") << "whole characters";
}

TEST(Text, WhatIsNotAllNeverReadsAsAll) {
  EXPECT_EQ(format_percent(1), "100.0 %");
  EXPECT_EQ(format_percent(0.9994), "99.9 %");
  EXPECT_EQ(format_percent(23325.0 / 23326.0), "99.9957 %");
}

TEST(Text, ASmallShareSaysWhatWasCounted) {
  EXPECT_EQ(format_share(1, 23326), "0.0043 % (1 of 23 326)");
  EXPECT_EQ(format_share(93, 10000), "0.9 % (93 of 10 000)");
  EXPECT_EQ(format_share(1421, 10000), "14.2 %");
  EXPECT_EQ(format_share(0, 23326), "none");
  EXPECT_EQ(format_share(0, 0), "-");
}

TEST(Text, ACellHasTheCountBeforeTheShare) {
  EXPECT_EQ(format_count_and_share(1, 23326), "1 (0.0043 %)");
  EXPECT_EQ(format_count_and_share(3319, 23326), "3 319 (14.2 %)");
  EXPECT_EQ(format_count_and_share(0, 23326), "0");
  EXPECT_EQ(format_count_and_share(0, 0), "-");
}

}  // namespace
}  // namespace redag
