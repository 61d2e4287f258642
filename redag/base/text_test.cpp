#include "redag/base/text.hpp"

#include <gtest/gtest.h>

#include <limits>

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
  EXPECT_FALSE(json_nests_deeper("", 0));
  EXPECT_FALSE(json_nests_deeper("[1, 2], [3]", 1));
  EXPECT_TRUE(json_nests_deeper(R"({"a": [1]})", 1));
  EXPECT_FALSE(json_nests_deeper(R"({"a": [1]})", 2));
  EXPECT_FALSE(json_nests_deeper(R"(["[[[\"[[", "\\"])", 1)) << "brackets in texts are text";
  EXPECT_TRUE(json_nests_deeper(std::string(1'000'000, '[')));
  EXPECT_FALSE(json_nests_deeper("]]]]"));
}

}  // namespace
}  // namespace redag
