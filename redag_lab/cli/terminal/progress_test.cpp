// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/cli/terminal/progress.hpp"

#include <gtest/gtest.h>

#include <string>

#include "redag_analysis/text/tint.hpp"

namespace redag::cli {
namespace {

TEST(ProgressLine, FitsTheTerminal) {
  EXPECT_EQ(progress_line("mte 1/3", 0.5, "1.0 of 2.0 s", 80), "mte 1/3 [##########          ]  50 %  1.0 of 2.0 s");
  EXPECT_EQ(display_width(progress_line("mte 1/3", 2.0, std::string(200, 'x'), 60)), 60U);
}

}  // namespace
}  // namespace redag::cli
