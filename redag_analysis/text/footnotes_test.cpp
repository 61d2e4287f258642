// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/text/footnotes.hpp"

#include <gtest/gtest.h>

namespace redag {
namespace {

TEST(Footnotes, EqualNotesStandOnce) {
  Footnotes notes;
  EXPECT_EQ(notes.mark("the first of all notes"), " [1]");
  EXPECT_EQ(notes.mark(""), "");
  EXPECT_EQ(notes.mark("another"), " [2]");
  EXPECT_EQ(notes.mark("the first of all notes"), " [1]");
  EXPECT_EQ(notes.render(0), "[1] the first of all notes\n[2] another\n");
  EXPECT_EQ(notes.render(20), "[1] the first of all\n    notes\n[2] another\n");
}

}  // namespace
}  // namespace redag
