// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Entities of callback groups, and how each becomes a Callback. A kind of entity has one file, which defines its class
// and its entity_of(). Nothing else distinguishes kinds. Pure functions; the caller may hold Registry::collect_lock_.
#pragma once

#include <functional>
#include <memory>
#include <vector>

#include "callback.hpp"
#include "rclcpp/callback_group.hpp"

namespace redag_rclcpp {

struct Entity {
  const void *key = nullptr;   // address of rclcpp's object
  const void *part = nullptr;  // a waitable of the group that belongs to this entity, if any
  redag::CallbackId id;        // without node; entities without a name still need their index
  rclcpp::CallbackGroup::SharedPtr group{};
  /// Makes the callback. Holds the entity.
  std::function<std::shared_ptr<Callback>(std::shared_ptr<ExecutorContext> context, redag::CallbackId id)> make;
};

[[nodiscard]] Entity entity_of(const rclcpp::TimerBase::SharedPtr &timer);
[[nodiscard]] Entity entity_of(const rclcpp::SubscriptionBase::SharedPtr &subscription);
[[nodiscard]] Entity entity_of(const rclcpp::ServiceBase::SharedPtr &service);
[[nodiscard]] Entity entity_of(const rclcpp::ClientBase::SharedPtr &client);
[[nodiscard]] Entity entity_of(const rclcpp::Waitable::SharedPtr &waitable);

/// The entities of a group that are callbacks of their own. Appends them.
void find_entities(const rclcpp::CallbackGroup::SharedPtr &group, std::vector<Entity> &found);

}  // namespace redag_rclcpp
