// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "transport.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <nlohmann/json.hpp>

namespace redag_rclcpp::lab {
namespace {

using redag::kMicrosecond;
using redag::kMillisecond;
using ::testing::Each;
using ::testing::Gt;
using ::testing::HasSubstr;

TransportFigures figures() {
  TransportFigures figures{.bytes = 64, .sent = 1001, .latencies = {}};
  for (int i = 1; i <= 1000; ++i) figures.latencies.push_back(i * kMicrosecond);
  return figures;
}

TEST(TransportFigures, HaveQuantilesAndAMargin) {
  EXPECT_EQ(quantile(figures(), 0.5), 500 * kMicrosecond);
  EXPECT_EQ(quantile(figures(), 0.999), 999 * kMicrosecond);
  EXPECT_EQ(quantile(figures(), 1), kMillisecond);
  EXPECT_EQ(quantile({.bytes = 64, .sent = 1, .latencies = {7}}, 0.5), 7);
  EXPECT_EQ(stated_transport(figures(), 1.5), 1500 * kMicrosecond);
  EXPECT_EQ(stated_transport({.bytes = 64, .sent = 1, .latencies = {1001}}, 1), 2 * kMicrosecond);
}

TEST(TransportFigures, SayWhatToWriteAndThatItIsNoBound) {
  const std::string text = describe({figures(), {.bytes = 128, .sent = 5, .latencies = {}}}, 1.5);
  EXPECT_THAT(text, HasSubstr("transport: 1.5ms  # 64 bytes: the largest of 1000 latencies"));
  EXPECT_THAT(text, HasSubstr("nothing arrived"));
  EXPECT_THAT(text, HasSubstr("is no bound"));
  const auto document = nlohmann::json::parse(to_json({figures()}, TransportOptions{}, 2));
  EXPECT_EQ(document["sizes"][0]["transport_ns"], 2 * kMillisecond);
  EXPECT_EQ(document["sizes"][0]["received"], 1000);
  EXPECT_EQ(document["sizes"][0]["sent"], 1001);
}

// Two processes, real messages. It forks, and must come before any other test that starts threads. How long they take
// is the machine's matter.
TEST(Transport, ReachesACallbackInAnotherProcess) {
  TransportOptions options;
  options.sizes = {kLeastMessage, 100'000};
  options.duration = 200 * kMillisecond;
  options.patience = 120 * redag::kSecond;
  const auto measured = measure_transport(options);
  ASSERT_TRUE(measured) << to_string(measured.error());
  ASSERT_EQ(measured->size(), 2U);
  for (const TransportFigures &each : *measured) {
    EXPECT_EQ(each.sent, 20U);
    EXPECT_GT(each.latencies.size(), 0U);
    EXPECT_LE(each.latencies.size(), each.sent);
    EXPECT_THAT(each.latencies, Each(Gt(0)));
    EXPECT_TRUE(std::is_sorted(each.latencies.begin(), each.latencies.end()));
  }
}

}  // namespace
}  // namespace redag_rclcpp::lab
