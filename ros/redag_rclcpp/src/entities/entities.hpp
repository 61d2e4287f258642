// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Entities of callback groups, and how each becomes a Callback. A kind of entity has one file, which defines its class
// and its entity_of(). Nothing else distinguishes kinds. Pure functions; the caller may hold Registry::collect_lock_.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "entities/callback.hpp"
#include "rclcpp/callback_group.hpp"
#include "rclcpp/context.hpp"

namespace redag_rclcpp {

struct Entity {
  const void *key = nullptr;    // address of rclcpp's object
  const void *part = nullptr;   // a waitable of the group that belongs to this entity, if any
  const void *owner = nullptr;  // the waitable whose timer this is, if any
  redag::CallbackId id;         // without node; entities without a name still need their index
  /// The name, if finding it takes so long that only a new callback is asked.
  std::function<std::string(rclcpp::Context &context)> name_of{};
  rclcpp::CallbackGroup::SharedPtr group{};
  bool in_default_group = false;
  /// Makes the callback. Holds the entity.
  std::function<std::shared_ptr<Callback>(std::shared_ptr<ExecutorContext> context, redag::CallbackId id)> make;
};

[[nodiscard]] Entity entity_of(const rclcpp::TimerBase::SharedPtr &timer);
[[nodiscard]] Entity entity_of(const rclcpp::SubscriptionBase::SharedPtr &subscription);
[[nodiscard]] Entity entity_of(const rclcpp::ServiceBase::SharedPtr &service);
[[nodiscard]] Entity entity_of(const rclcpp::ClientBase::SharedPtr &client);
[[nodiscard]] Entity entity_of(const rclcpp::Waitable::SharedPtr &waitable);
/// A timer that belongs to a waitable. It is to be called only if the waitable's hook reports arrivals: a wait set that
/// watches the waitable watches its timers, too.
[[nodiscard]] Entity entity_of(const rclcpp::Waitable::SharedPtr &waitable, const rclcpp::TimerBase::SharedPtr &timer);

/// The entities of a group that are callbacks of their own. Appends them, the timers of a waitable after it.
void find_entities(const rclcpp::CallbackGroup::SharedPtr &group, std::vector<Entity> &found);

}  // namespace redag_rclcpp
