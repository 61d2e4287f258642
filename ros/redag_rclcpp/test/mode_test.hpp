// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Base of tests that run ReDAGExecutor in each preemption mode: a node, and options with one worker.
#pragma once

#include <gtest/gtest.h>

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "parse.hpp"
#include "rclcpp/rclcpp.hpp"
#include "redag/threads/setup.hpp"
#include "redag_rclcpp/executor.hpp"
#include "test_msgs/msg/empty.hpp"

namespace redag_rclcpp {

using test_msgs::msg::Empty;

class ModeTest : public ::testing::TestWithParam<redag::PreemptionMode> {
 protected:
  void SetUp() override {
    if (GetParam() == redag::PreemptionMode::Os && redag::runtime::probe_priority_band().top_job == 0) {
      GTEST_SKIP() << "SCHED_FIFO is not to be had here";
    }
    rclcpp::init(0, nullptr);
    node = std::make_shared<rclcpp::Node>("node", rclcpp::NodeOptions().use_intra_process_comms(true));
    options.preemption = GetParam();
    options.workers = 1;
  }
  void TearDown() override {
    node.reset();
    if (rclcpp::ok()) rclcpp::shutdown();
  }

  rclcpp::CallbackGroup::SharedPtr new_group() {
    return groups.emplace_back(node->create_callback_group(rclcpp::CallbackGroupType::MutuallyExclusive));
  }
  rclcpp::Subscription<Empty>::SharedPtr subscribe(const std::string &topic, std::function<void()> body) {
    rclcpp::SubscriptionOptions subscription;
    subscription.callback_group = new_group();
    return node->create_subscription<Empty>(
        topic, rclcpp::QoS(10), [body](Empty::ConstSharedPtr) { body(); }, subscription);
  }
  rclcpp::Publisher<Empty>::SharedPtr publisher(const std::string &topic) {
    return node->create_publisher<Empty>(topic, rclcpp::QoS(10));
  }

  rclcpp::Node::SharedPtr node;
  std::vector<rclcpp::CallbackGroup::SharedPtr> groups;
  ReDAGOptions options;
};

}  // namespace redag_rclcpp
