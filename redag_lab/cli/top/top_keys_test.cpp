// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/cli/top/top_keys.hpp"

#include <gtest/gtest.h>

namespace redag::cli {
namespace {

class Keys : public ::testing::Test {
 protected:
  Keys() {
    for (const char *dag : {"fast", "slow"}) {
      places_.names.emplace_back(dag);
      for (const char *task : {"sense", "plan", "act"}) places_.names.push_back(std::string(dag) + "." + task);
    }
    places_.page = 3;
    places_.titles_line = 5;
    places_.rows_line = 6;
    places_.titles = {{0, 10, LiveOrder::Name}, {10, 18, LiveOrder::P99}, {18, 30, std::nullopt}};
    places_.executors = 3;
    places_.executors_line = 2;
    places_.help_lines = 20;
    places_.has_frame = true;
  }

  TopAction press(Key key) { return cli::press({key}, places_, state_); }
  TopAction press(const std::string &text) {
    TopAction last = TopAction::None;
    for (const char c : text) last = cli::press({Key::Text, c}, places_, state_);
    return last;
  }
  TopAction click(std::size_t line, std::size_t column) {
    return cli::press({.key = Key::Click, .line = line, .column = column}, places_, state_);
  }
  [[nodiscard]] std::string marked() const { return places_.names[state_.cursor]; }

  TopPlaces places_;
  TopState state_;
};

TEST_F(Keys, TheMarkStaysWithinTheRows) {
  press(Key::Up);
  EXPECT_EQ(state_.cursor, 0U);
  press(Key::Down);
  press("j");
  EXPECT_EQ(state_.cursor, 2U);
  press("k");
  press(Key::PageDown);
  EXPECT_EQ(state_.cursor, 4U);
  press(Key::WheelDown);
  EXPECT_EQ(state_.cursor, 7U);
  press(Key::Down);
  press(Key::PageDown);
  EXPECT_EQ(state_.cursor, 7U);
  press(Key::WheelUp);
  EXPECT_EQ(state_.cursor, 4U);
  press(Key::PageUp);
  press(Key::PageUp);
  EXPECT_EQ(state_.cursor, 0U);
  press(Key::End);
  EXPECT_EQ(state_.cursor, 7U);
  press(Key::Home);
  EXPECT_EQ(state_.cursor, 0U);
  places_.names.clear();
  press(Key::End);
  EXPECT_EQ(state_.cursor, 0U);
}

TEST_F(Keys, OrdersByLetterAndByStep) {
  for (const auto &[letter, order] : {std::pair{'n', LiveOrder::Name},
                                      {'r', LiveOrder::Rate},
                                      {'p', LiveOrder::P99},
                                      {'x', LiveOrder::Longest},
                                      {'m', LiveOrder::Misses},
                                      {'c', LiveOrder::Cpu},
                                      {'d', LiveOrder::Dag}}) {
    state_.cursor = 3;
    press(std::string(1, letter));
    EXPECT_EQ(state_.view.order, order);
    EXPECT_EQ(state_.cursor, 0U);
  }
  press(">>");
  EXPECT_EQ(state_.view.order, LiveOrder::Rate);
  press("<<<");
  EXPECT_EQ(state_.view.order, LiveOrder::Cpu);
  press("i");
  EXPECT_TRUE(state_.view.reversed);
  press("g");
  EXPECT_TRUE(state_.view.dags_only);
  press("t");
  EXPECT_TRUE(state_.view.since_start);
  press(" ");
  EXPECT_TRUE(state_.paused);
  press("igt ");
  EXPECT_FALSE(state_.view.reversed || state_.view.dags_only || state_.view.since_start || state_.paused);
}

TEST_F(Keys, AFilterActsWhileItIsTyped) {
  state_.cursor = 5;
  press("f");
  EXPECT_EQ(state_.mode, TopMode::Filter);
  press("qp");  // letters, not keys
  EXPECT_EQ(state_.view.filter, "qp");
  EXPECT_EQ(state_.cursor, 0U);
  press(Key::Backspace);
  press(Key::Backspace);
  press(Key::Backspace);
  press("plan");
  press(Key::Enter);
  EXPECT_EQ(state_.mode, TopMode::Table);
  EXPECT_EQ(state_.view.filter, "plan");
  press("f");
  EXPECT_EQ(state_.typed, "plan");
  press(Key::Escape);
  EXPECT_EQ(state_.mode, TopMode::Table);
  EXPECT_EQ(state_.view.filter, "");
  press("fact");
  press(Key::Enter);
  EXPECT_EQ(press(Key::Escape), TopAction::None) << "takes back the filter first";
  EXPECT_EQ(state_.view.filter, "");
  EXPECT_EQ(press(Key::Escape), TopAction::Quit);
}

TEST_F(Keys, WhatIsTypedHasAnEnd) {
  press("f" + std::string(1000, 'x'));
  EXPECT_EQ(state_.view.filter, std::string(60, 'x'));
}

TEST_F(Keys, ASearchMovesTheMark) {
  press("/PLA");
  EXPECT_EQ(state_.mode, TopMode::Search);
  EXPECT_EQ(marked(), "fast.plan");
  press(Key::Enter);
  EXPECT_EQ(state_.mode, TopMode::Table);
  press("N");
  EXPECT_EQ(marked(), "slow.plan");
  press("N");
  EXPECT_EQ(marked(), "fast.plan");
  press("/nothing");
  EXPECT_EQ(marked(), "fast.plan");
  press(Key::Escape);
  EXPECT_EQ(state_.mode, TopMode::Table);
  EXPECT_EQ(state_.view.filter, "");
  state_.sought.clear();
  press("N");
  EXPECT_EQ(marked(), "fast.plan");
  places_.names.clear();
  press("/x");
}

TEST_F(Keys, HelpScrollsAndGoes) {
  press("?");
  EXPECT_EQ(state_.mode, TopMode::Help);
  press(Key::End);
  EXPECT_EQ(state_.first, 17U);
  press(Key::Home);
  press(Key::Down);
  EXPECT_EQ(state_.first, 1U);
  press("x");
  EXPECT_EQ(state_.mode, TopMode::Table);
  EXPECT_EQ(state_.view.order, LiveOrder::Dag) << "the letter only leaves the help";
  press(Key::Help);
  EXPECT_EQ(state_.mode, TopMode::Help);
  EXPECT_EQ(press("q"), TopAction::Quit);
}

TEST_F(Keys, AnExecutorIsChosen) {
  press("l");
  EXPECT_EQ(state_.mode, TopMode::Choose);
  press(Key::Down);
  EXPECT_EQ(state_.chosen, 1U);
  EXPECT_EQ(press(Key::Enter), TopAction::Attach);
  EXPECT_EQ(press("3"), TopAction::Attach);
  EXPECT_EQ(state_.chosen, 2U);
  EXPECT_EQ(press("7"), TopAction::None) << "there are only three";
  EXPECT_EQ(state_.chosen, 2U);
  EXPECT_EQ(click(2, 5), TopAction::Attach);
  EXPECT_EQ(state_.chosen, 0U);
  EXPECT_EQ(click(1, 5), TopAction::None);
  EXPECT_EQ(click(5, 5), TopAction::None);
  places_.first_executor = 1;
  EXPECT_EQ(click(2, 5), TopAction::Attach);
  EXPECT_EQ(state_.chosen, 1U);
  EXPECT_EQ(press(Key::Escape), TopAction::None);
  EXPECT_EQ(state_.mode, TopMode::Table);
  press("l");
  places_.has_frame = false;
  EXPECT_EQ(press(Key::Escape), TopAction::Quit) << "there is nothing behind the list";
}

TEST_F(Keys, AClickMarksARowOrSorts) {
  state_.first = 2;
  click(7, 40);
  EXPECT_EQ(state_.cursor, 3U);
  click(9, 40);  // below the rows
  EXPECT_EQ(state_.cursor, 3U);
  click(5, 12);
  EXPECT_EQ(state_.view.order, LiveOrder::P99);
  click(5, 17);
  EXPECT_TRUE(state_.view.reversed);
  click(5, 3);
  EXPECT_EQ(state_.view.order, LiveOrder::Name);
  EXPECT_FALSE(state_.view.reversed);
  click(5, 3);
  EXPECT_EQ(state_.view.order, LiveOrder::Dag);
  click(5, 20);  // not a column to sort by
  click(4, 3);
  EXPECT_EQ(state_.view.order, LiveOrder::Dag);
}

TEST_F(Keys, TheTerminalCanGoInEachMode) {
  for (const TopMode mode : {TopMode::Table, TopMode::Choose, TopMode::Help, TopMode::Filter, TopMode::Search}) {
    state_.mode = mode;
    EXPECT_EQ(press(Key::Closed), TopAction::Quit);
    state_.mode = mode;
    EXPECT_EQ(press(Key::None), TopAction::None);
    EXPECT_EQ(press(Key::Resize), TopAction::None);
    EXPECT_EQ(state_.mode, mode);
  }
}

}  // namespace
}  // namespace redag::cli
