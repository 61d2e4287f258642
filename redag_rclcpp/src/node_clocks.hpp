// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// NodeClocks sets the clocks of nodes with `use_sim_time`, in the place of the threads with which rclcpp hears /clock.
// Such a thread sets its node's clock at some moment after the message. It could fall in the middle of an instant. A
// clock is set by the node's own subscription, which is called as an executor would. Only one thread may call it.
#pragma once

#include <memory>
#include <vector>

#include "rclcpp/callback_group.hpp"
#include "rclcpp/context.hpp"
#include "rclcpp/node_interfaces/node_base_interface.hpp"
#include "rclcpp/subscription_base.hpp"
#include "redag/base/time.hpp"

namespace redag_rclcpp {

class NodeClocks {
 public:
  explicit NodeClocks(rclcpp::Context::SharedPtr context) : context_(std::move(context)) {}
  ~NodeClocks() { release(); }
  NodeClocks(const NodeClocks &) = delete;
  NodeClocks &operator=(const NodeClocks &) = delete;

  /// Takes the places of the threads of these nodes. False: a thread is in the middle of a message; call it again.
  [[nodiscard]] bool hold(const std::vector<rclcpp::node_interfaces::NodeBaseInterface::SharedPtr> &nodes);
  /// Sets the clocks. Messages on /clock are dropped.
  void set(redag::Time time);
  /// Gives the threads their places back.
  void release();

 private:
  struct Held {
    std::weak_ptr<rclcpp::SubscriptionBase> subscription;
    rclcpp::CallbackGroup::WeakPtr group;
  };
  void wake_thread(rclcpp::CallbackGroup &group) const;

  const rclcpp::Context::SharedPtr context_;
  std::vector<Held> held_;
};

}  // namespace redag_rclcpp
