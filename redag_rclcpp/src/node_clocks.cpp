// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "node_clocks.hpp"

#include <algorithm>

#include "compat.hpp"
#include "rclcpp/subscription.hpp"
#include "rclcpp/time.hpp"
#include "rmw/rmw.h"
#include "rosgraph_msgs/msg/clock.hpp"

namespace redag_rclcpp {

using rosgraph_msgs::msg::Clock;

// A mutually exclusive group whose flag is false is executed by somebody else: the thread's executor leaves it out. It
// looks at the flag and clears it in two steps. No message is on its way when the executors follow a player, which has
// not begun to publish then.
bool NodeClocks::hold(const std::vector<rclcpp::node_interfaces::NodeBaseInterface::SharedPtr> &nodes) {
  std::erase_if(held_, [](const Held &held) { return held.subscription.expired(); });
  bool all = true;
  for (const auto &node : nodes) {
    node->for_each_callback_group([&](const rclcpp::CallbackGroup::SharedPtr &group) {
      if (group->automatically_add_to_executor_with_node()) return;  // the executor's, or the user's
      const auto subscription = group->find_subscription_ptrs_if([](const rclcpp::SubscriptionBase::SharedPtr &one) {
        return dynamic_cast<rclcpp::Subscription<Clock> *>(one.get()) != nullptr;
      });
      const auto is_same = [&](const Held &held) { return held.subscription.lock() == subscription; };
      if (!subscription || std::any_of(held_.begin(), held_.end(), is_same)) return;
      if (!group->can_be_taken_from().exchange(false)) {
        all = false;
        return;
      }
      held_.push_back({subscription, group});
      wake_thread(*group);
    });
  }
  return all;
}

void NodeClocks::set(redag::Time time) {
  rclcpp::MessageInfo info;
  rclcpp::MessageInfo own;  // of a publisher that nobody knows
  own.get_rmw_message_info().publisher_gid.implementation_identifier = rmw_get_implementation_identifier();
  for (const Held &held : held_) {
    const auto subscription = held.subscription.lock();
    if (!subscription) continue;
    std::shared_ptr<void> message = subscription->create_message();
    while (subscription->take_type_erased(message.get(), info)) {
    }
    static_cast<Clock *>(message.get())->clock = rclcpp::Time(time, RCL_ROS_TIME);
    subscription->handle_message(message, own);
    subscription->return_message(message);
  }
}

void NodeClocks::release() {
  for (const Held &held : held_) {
    if (const auto group = held.group.lock()) {
      group->can_be_taken_from().store(true);
      wake_thread(*group);
    }
  }
  held_.clear();
}

// The thread's executor collects its entities anew: with or without the subscription.
void NodeClocks::wake_thread(rclcpp::CallbackGroup &group) const {
  try {
    if (const auto condition = compat::notify_guard_condition(group, context_)) condition->trigger();
  } catch (const rclcpp::exceptions::RCLError &) {
    // The context was shut down, which ends the thread.
  }
}

}  // namespace redag_rclcpp
