// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// A ring of subscriptions in one node: each callback publishes to the next subscription, so that the executor is never
// idle. No other process has topics of the same names, because messages would go there, too.
#pragma once

#include <unistd.h>

#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "rclcpp/rclcpp.hpp"
#include "std_msgs/msg/u_int64.hpp"

namespace redag_rclcpp::lab {

class Ring {
 public:
  using Message = std_msgs::msg::UInt64;

  /// `go_on` is called in every callback. If it returns false, the message stops there. With `middleware`, messages go
  /// through it. The group is reentrant, so that any thread may take the next callback before this one has ended.
  Ring(std::size_t count, std::function<bool()> go_on, bool middleware = false)
      : go_on_(std::move(go_on)), node_(make_node(!middleware)) {
    rclcpp::SubscriptionOptions options;
    options.callback_group = group_ = node_->create_callback_group(rclcpp::CallbackGroupType::Reentrant);
    for (std::size_t i = 0; i < count; ++i) {
      publishers_.push_back(node_->create_publisher<Message>("ring" + std::to_string(i), rclcpp::QoS(10)));
    }
    for (std::size_t i = 0; i < count; ++i) {
      subscriptions_.push_back(node_->create_subscription<Message>(
          "ring" + std::to_string(i), rclcpp::QoS(10),
          [this, next = publishers_[(i + 1) % count]](Message::UniquePtr message) {
            if (go_on_()) next->publish(std::move(message));
          },
          options));
    }
  }
  Ring(const Ring &) = delete;
  Ring &operator=(const Ring &) = delete;

  [[nodiscard]] const rclcpp::Node::SharedPtr &node() const { return node_; }
  void publish() { publishers_[0]->publish(std::make_unique<Message>()); }

 private:
  static rclcpp::Node::SharedPtr make_node(bool intra_process) {
    return std::make_shared<rclcpp::Node>("bench", "process_" + std::to_string(getpid()),
                                          rclcpp::NodeOptions().use_intra_process_comms(intra_process));
  }

  std::function<bool()> go_on_;
  rclcpp::Node::SharedPtr node_;
  rclcpp::CallbackGroup::SharedPtr group_;
  std::vector<rclcpp::Publisher<Message>::SharedPtr> publishers_;
  std::vector<rclcpp::Subscription<Message>::SharedPtr> subscriptions_;
};

}  // namespace redag_rclcpp::lab
