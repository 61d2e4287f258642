// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// conformance_*_test.cpp check what users of any rclcpp executor rely on, for ReDAGExecutor and for rclcpp's own
// executors. They wait for events with a generous limit, and assert nothing about speed.
#pragma once

#include <gtest/gtest.h>

#include <memory>

#include "executor_types.hpp"
#include "rclcpp/rclcpp.hpp"

namespace redag_rclcpp {

template <class T>
class Conformance : public ::testing::Test {
 protected:
  void SetUp() override {
    if (!can_run<T>()) GTEST_SKIP() << "SCHED_FIFO is not to be had here";
    rclcpp::init(0, nullptr);
    node = std::make_shared<rclcpp::Node>("node");
    executor = std::make_unique<T>();
  }
  void TearDown() override {
    executor.reset();
    node.reset();
    if (rclcpp::ok()) rclcpp::shutdown();
  }
  /// Replaces the executor after a node with several groups was removed. Humble's executors keep pointers to the guard
  /// conditions of these groups, and use them at the next spin. ReDAGExecutor must go on without replacement.
  void renew_executor() {
    if (!kOurs<T>) executor = std::make_unique<T>();
  }

  std::shared_ptr<rclcpp::Node> node;
  std::unique_ptr<T> executor;
};
TYPED_TEST_SUITE(Conformance, AllTypes, TypeNames);

}  // namespace redag_rclcpp
