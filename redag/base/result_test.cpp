// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/base/result.hpp"

#include <gtest/gtest.h>

#include "redag/base/check.hpp"

namespace redag {
namespace {

TEST(Diagnostic, SaysWhereWhatAndWhatToDo) {
  const Diagnostic mistake{Severity::Error, "cart.yaml", 4, 12, "unknown key 'wect'", "did you mean 'wcet'?"};
  EXPECT_EQ(mistake.to_string(), "cart.yaml:4:12: error: unknown key 'wect' (did you mean 'wcet'?)");
}

TEST(Diagnostic, LeavesOutWhatIsNotKnown) {
  EXPECT_EQ((Diagnostic{Severity::Warning, {}, 0, 0, "slow", {}}).to_string(), "warning: slow");
  EXPECT_EQ((Diagnostic{Severity::Error, "a.yaml", 0, 0, "is a directory", {}}).to_string(),
            "a.yaml: error: is a directory");
}

TEST(Diagnostic, SteersNoTerminal) {
  const Diagnostic mistake{Severity::Error, "\x1b[31m.yaml", 0, 0, "\x1b]0;title\x07", "\x1b[2J"};
  EXPECT_EQ(mistake.to_string().find('\x1b'), std::string::npos) << mistake.to_string();
}

TEST(Diagnostics, OneALine) {
  const Result<int> bad = make_error("no", "yes");
  Diagnostics both = bad.error();
  both.push_back(both.front());
  EXPECT_EQ(to_string(both), "error: no (yes)\nerror: no (yes)");
}

TEST(CheckDeathTest, SaysWhatBroke) {
  EXPECT_DEATH(REDAG_CHECK(1 + 1 == 3, "sums add up"), "sums add up \\[1 \\+ 1 == 3\\]");
}

}  // namespace
}  // namespace redag
