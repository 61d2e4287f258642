// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/cli/top/top_keys.hpp"

#include <gtest/gtest.h>

#include <string>

namespace redag::cli {
namespace {

class Keys : public ::testing::Test {
 protected:
  TopAction press(Key key) { return cli::press({key}, state_); }
  TopAction press(const std::string &text) {
    TopAction last = TopAction::None;
    for (const char c : text) last = cli::press({Key::Text, c}, state_);
    return last;
  }

  TopState state_{.page = 5};
};

TEST_F(Keys, Scroll) {
  press(Key::Up);
  EXPECT_EQ(state_.first, 0U);
  press(Key::Down);
  press(Key::PageDown);
  EXPECT_EQ(state_.first, 6U);
  press(Key::Up);
  press(Key::PageUp);
  press(Key::PageUp);
  EXPECT_EQ(state_.first, 0U);
  press(Key::End);
  EXPECT_GT(state_.first, 1'000'000U) << "drawing limits it to the rows";
  press(Key::Home);
  EXPECT_EQ(state_.first, 0U);
}

TEST_F(Keys, ChooseTheRows) {
  press(">>");
  EXPECT_EQ(state_.view.order, LiveOrder::Longest);
  press("<<<");
  EXPECT_EQ(state_.view.order, LiveOrder::Cpu);
  press(">");
  EXPECT_EQ(state_.view.order, LiveOrder::Dag);
  press("a ");
  EXPECT_TRUE(state_.view.all && state_.paused);
  press("a ");
  EXPECT_FALSE(state_.view.all || state_.paused);
}

TEST_F(Keys, HelpScrollsAndGoes) {
  press("?");
  EXPECT_EQ(state_.mode, TopMode::Help);
  press(Key::Down);
  EXPECT_EQ(state_.first, 1U);
  press("a");
  EXPECT_EQ(state_.mode, TopMode::Table);
  EXPECT_EQ(state_.first, 0U);
  EXPECT_FALSE(state_.view.all) << "the letter only leaves the help";
  press("h");
  EXPECT_EQ(press("q"), TopAction::Quit);
  state_.mode = TopMode::Table;
  EXPECT_EQ(press(Key::Escape), TopAction::Quit);
}

TEST_F(Keys, TabShowsOneExecutorAndThenTheNext) {
  press("a");
  EXPECT_EQ(press(Key::Tab), TopAction::None);
  EXPECT_FALSE(state_.view.all);
  EXPECT_EQ(press(Key::Tab), TopAction::Next);
}

TEST_F(Keys, TheTerminalCanGoInEachMode) {
  for (const TopMode mode : {TopMode::Table, TopMode::Help}) {
    state_.mode = mode;
    EXPECT_EQ(press(Key::Closed), TopAction::Quit);
    EXPECT_EQ(press(Key::None), TopAction::None);
    EXPECT_EQ(state_.mode, mode);
  }
}

}  // namespace
}  // namespace redag::cli
