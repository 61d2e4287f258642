// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/live/process.hpp"

#include <gtest/gtest.h>

namespace redag::live {
namespace {

TEST(TextOfProc, IsEmptyWhereNothingCanBeRead) {
  EXPECT_NE(text_of_proc("/proc/self/stat"), "");
  EXPECT_EQ(text_of_proc("/proc/0/stat"), "");
  // It can be opened, and reading its begin fails, as does /proc/PID/stat of a process that has ended meanwhile.
  EXPECT_EQ(text_of_proc("/proc/self/mem"), "");
}

}  // namespace
}  // namespace redag::live
