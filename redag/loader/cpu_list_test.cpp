// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/loader/cpu_list.hpp"

#include <gtest/gtest.h>

namespace redag {
namespace {

using Cpus = std::vector<int>;

TEST(CpuList, ReadsNumbersAndRanges) {
  EXPECT_EQ(parse_cpu_list("3"), Cpus({3}));
  EXPECT_EQ(parse_cpu_list("4,0-2"), Cpus({0, 1, 2, 4}));
  EXPECT_EQ(parse_cpu_list("1,1-1,0-1"), Cpus({0, 1}));
  EXPECT_EQ(parse_cpu_list("4095"), Cpus({kMaxCpu}));
}

TEST(CpuList, RejectsEverythingElse) {
  for (const char *text : {"", ",", "1,", "-1", "2-1", "a", "1 2", "1-", "99999999999", "5000", "0x1"}) {
    EXPECT_EQ(parse_cpu_list(text), std::nullopt) << text;
  }
}

TEST(CpuList, IsWrittenWithRanges) {
  for (const char *text : {"0", "0-1", "0,2", "0-2,4,6-7", "4095"}) {
    EXPECT_EQ(format_cpu_list(parse_cpu_list(text).value()), text);
  }
  EXPECT_EQ(format_cpu_list({}), "");
}

}  // namespace
}  // namespace redag
