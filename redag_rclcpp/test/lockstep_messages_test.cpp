// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "redag_rclcpp/lockstep.hpp"

namespace redag_rclcpp {
namespace {

using testing::HasSubstr;

TEST(LockstepMessages, AreReadAsTheyWereWritten) {
  const lockstep::Order order{.kind = lockstep::Order::Kind::Instant,
                              .session = "s",
                              .player = "p",
                              .instant = 3,
                              .time = 5,
                              .published = {{"/a", 2}}};
  const auto read = lockstep::parse_order(to_text(order));
  ASSERT_TRUE(read);
  EXPECT_EQ(to_text(*read), to_text(order));
  lockstep::Report report{.kind = lockstep::Report::Kind::Busy,
                          .session = "s",
                          .executor = "e",
                          .instant = 3,
                          .jobs = 4,
                          .order = ~0ULL,
                          .text = "t",
                          .outside = {{"x", 1}},
                          .subscriptions = {{"/a", 2}}};
  const auto read_report = lockstep::parse_report(to_text(report));
  ASSERT_TRUE(read_report);
  EXPECT_EQ(to_text(*read_report), to_text(report));
  EXPECT_THAT(to_string(lockstep::parse_order("{\"kind\": \"leap\"}").error()), HasSubstr("'kind' is 'leap'"));
  EXPECT_FALSE(lockstep::parse_report("nonsense"));
}

}  // namespace
}  // namespace redag_rclcpp
