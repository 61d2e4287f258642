// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Hides differences between ROS 2 distributions behind one set of names. Humble has rclcpp 16, Jazzy 28, Kilted 29,
// Lyrical 32. Where a declaration of rclcpp tells what it can do, it is asked instead of the version: fixes of newer
// distributions reach older ones. See also redag_rclcpp/distribution.hpp.
#pragma once

#include <tracetools/tracetools.h>

#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "rclcpp/callback_group.hpp"
#include "rclcpp/client.hpp"
#include "rclcpp/clock.hpp"
#include "rclcpp/context.hpp"
#include "rclcpp/executor.hpp"
#include "rclcpp/guard_condition.hpp"
#include "rclcpp/node.hpp"
#include "rclcpp/service.hpp"
#include "rclcpp/subscription_base.hpp"
#include "rclcpp/timer.hpp"
#include "rclcpp/version.h"
#include "rclcpp/waitable.hpp"
#include "rclcpp_action/client.hpp"
#include "rclcpp_action/server.hpp"
#if RCLCPP_VERSION_MAJOR < 21
#include "rclcpp/qos_event.hpp"
#else
#include "rclcpp/event_handler.hpp"
#endif

#ifndef TRACETOOLS_TRACEPOINT  // its name before Jazzy
#define TRACETOOLS_TRACEPOINT TRACEPOINT
#endif

namespace redag_rclcpp::compat {

// ---- waitables ----

// Since Jazzy waitables take the wait set and the data by reference.
#if RCLCPP_VERSION_MAJOR >= 28
inline void add_to_wait_set(rclcpp::Waitable &waitable, rcl_wait_set_t &set) { waitable.add_to_wait_set(set); }
inline bool is_ready(rclcpp::Waitable &waitable, const rcl_wait_set_t &set) { return waitable.is_ready(set); }
inline void execute(rclcpp::Waitable &waitable, const std::shared_ptr<void> &data) { waitable.execute(data); }
#else
inline void add_to_wait_set(rclcpp::Waitable &waitable, rcl_wait_set_t &set) { waitable.add_to_wait_set(&set); }
inline bool is_ready(rclcpp::Waitable &waitable, rcl_wait_set_t &set) { return waitable.is_ready(&set); }
inline void execute(rclcpp::Waitable &waitable, std::shared_ptr<void> &data) { waitable.execute(data); }
#endif

/// True if the waitable's on-ready hook is not reliable:
/// - Before Lyrical action servers report expired goals to wait sets only (rclcpp issue 2661). Fixes for some versions
///   of Jazzy and Kilted cannot be told from here. There the wait set costs nothing but the exact arrival times of
///   goals.
/// - Action clients of Humble call the hook with too few arguments for arrivals before it was set.
inline bool needs_wait_set(const rclcpp::Waitable &waitable) {
#if RCLCPP_VERSION_MAJOR < 32
  if (dynamic_cast<const rclcpp_action::ServerBase *>(&waitable) != nullptr) return true;
#endif
#if RCLCPP_VERSION_MAJOR < 21
  return dynamic_cast<const rclcpp_action::ClientBase *>(&waitable) != nullptr;
#else
  (void)waitable;
  return false;
#endif
}

/// The middleware's part of a QoS event, if its hook has to be set below rclcpp. Humble's QoS events call their
/// on-ready hook with too few arguments for events before it was set. Null for all other waitables.
inline std::shared_ptr<rcl_event_t> event_to_hook(const rclcpp::Waitable::SharedPtr &waitable) {
#if RCLCPP_VERSION_MAJOR < 21
  struct Opened : rclcpp::QOSEventHandlerBase {
    using QOSEventHandlerBase::event_handle_;
  };
  if (const auto event = std::dynamic_pointer_cast<rclcpp::QOSEventHandlerBase>(waitable)) {
    return {event, &((*event).*(&Opened::event_handle_))};
  }
#else
  (void)waitable;
#endif
  return nullptr;
}

/// The timers of a waitable. An executor that waits for the waitable's hook has to call them when they are due. Since
/// Kilted waitables have such timers. That of an action server expires goals.
template <class Waitable>
std::vector<rclcpp::TimerBase::SharedPtr> timers_of(const Waitable &waitable) {
  if constexpr (requires { waitable.get_timers(); }) {
    return waitable.get_timers();
  } else {
    return {};
  }
}

// ---- hooks of users ----

namespace detail {

template <class Entity, class Function>
bool is_set(Entity &entity, std::recursive_mutex Entity::*lock, Function Entity::*hook) {
  const std::lock_guard<std::recursive_mutex> guard(entity.*lock);
  return static_cast<bool>(entity.*hook);
}

#if RCLCPP_VERSION_MAJOR < 21
// Humble's SubscriptionBase keeps these members private. The arguments of an explicit instantiation may name them.
struct SubscriptionLock {
  friend std::recursive_mutex rclcpp::SubscriptionBase::*member(SubscriptionLock);
};
struct SubscriptionHook {
  friend std::function<void(std::size_t)> rclcpp::SubscriptionBase::*member(SubscriptionHook);
};
template <class Tag, auto kMember>
struct Reveal {
  friend decltype(kMember) member(Tag) { return kMember; }
};
template struct Reveal<SubscriptionLock, &rclcpp::SubscriptionBase::callback_mutex_>;
template struct Reveal<SubscriptionHook, &rclcpp::SubscriptionBase::on_new_message_callback_>;
#endif

}  // namespace detail

/// True if the user has set a callback of rclcpp's for new messages, requests, responses or events of the entity. The
/// middleware has one place for such a callback, so that the executor must leave it alone.
inline bool is_hooked_by_user(rclcpp::SubscriptionBase &subscription) {
#if RCLCPP_VERSION_MAJOR < 21
  return detail::is_set(subscription, member(detail::SubscriptionLock()), member(detail::SubscriptionHook()));
#else
  struct Opened : rclcpp::SubscriptionBase {
    using SubscriptionBase::callback_mutex_;
    using SubscriptionBase::on_new_message_callback_;
  };
  return detail::is_set(subscription, &Opened::callback_mutex_, &Opened::on_new_message_callback_);
#endif
}
inline bool is_hooked_by_user(rclcpp::ServiceBase &service) {
  struct Opened : rclcpp::ServiceBase {
    using ServiceBase::callback_mutex_;
    using ServiceBase::on_new_request_callback_;
  };
  return detail::is_set(service, &Opened::callback_mutex_, &Opened::on_new_request_callback_);
}
inline bool is_hooked_by_user(rclcpp::ClientBase &client) {
  struct Opened : rclcpp::ClientBase {
    using ClientBase::callback_mutex_;
    using ClientBase::on_new_response_callback_;
  };
  return detail::is_set(client, &Opened::callback_mutex_, &Opened::on_new_response_callback_);
}
/// Of the waitables only QoS events offer users such a callback. The executor's own hook counts as well, unless it was
/// set below rclcpp.
inline bool is_hooked_by_user(rclcpp::Waitable &waitable) {
#if RCLCPP_VERSION_MAJOR < 21
  using EventHandler = rclcpp::QOSEventHandlerBase;
#else
  using EventHandler = rclcpp::EventHandlerBase;
#endif
  struct Opened : EventHandler {
    using EventHandler::callback_mutex_;
    using EventHandler::on_new_event_callback_;
  };
  auto *const event = dynamic_cast<EventHandler *>(&waitable);
  return event != nullptr && detail::is_set(*event, &Opened::callback_mutex_, &Opened::on_new_event_callback_);
}

// ---- groups and services ----

/// Null if the group has no guard condition yet and its context is gone.
inline rclcpp::GuardCondition::SharedPtr notify_guard_condition(rclcpp::CallbackGroup &group,
                                                                const rclcpp::Context::SharedPtr &context) {
#if RCLCPP_VERSION_MAJOR >= 28
  (void)context;
  return group.get_notify_guard_condition();
#else
  return group.get_notify_guard_condition(context);
#endif
}

/// The default QoS of services, in the form that rclcpp::Node::create_service() takes.
inline auto services_qos() {
#if RCLCPP_VERSION_MAJOR >= 28
  return rclcpp::ServicesQoS();
#else
  return rmw_qos_profile_services_default;
#endif
}

// ---- timers ----

/// Consumes a timer's expiry, which makes the next one known. False or null: the timer was cancelled.
[[nodiscard]] inline auto begin_call(rclcpp::TimerBase &timer) { return timer.call(); }
#if RCLCPP_VERSION_MAJOR >= 28
inline void execute(rclcpp::TimerBase &timer, const std::shared_ptr<void> &call) { timer.execute_callback(call); }
#else
inline void execute(rclcpp::TimerBase &timer, bool) { timer.execute_callback(); }
#endif

/// True if the timer itself reports resets. Otherwise its guard condition does. Jumps of ROS time are always reported
/// by the guard condition.
#if RCLCPP_VERSION_MAJOR >= 21
inline constexpr bool kTimersTellOfResets = true;
inline void set_on_reset(rclcpp::TimerBase &timer, std::function<void()> callback) {
  timer.set_on_reset_callback([callback = std::move(callback)](std::size_t) { callback(); });
}
inline void clear_on_reset(rclcpp::TimerBase &timer) { timer.clear_on_reset_callback(); }
#else
inline constexpr bool kTimersTellOfResets = false;
inline void set_on_reset(rclcpp::TimerBase &, const std::function<void()> &) {}
inline void clear_on_reset(rclcpp::TimerBase &) {}
#endif

/// The clock of a timer, a protected member of rclcpp::TimerBase.
inline rclcpp::Clock::SharedPtr clock_of(rclcpp::TimerBase &timer) {
  struct Opened : rclcpp::TimerBase {
    using rclcpp::TimerBase::clock_;
  };
  return timer.*(&Opened::clock_);
}

// ---- the base class of the executor ----

/// Address of a guard condition of rclcpp::Executor, which holds it by value or by pointer.
inline rclcpp::GuardCondition *address_of(rclcpp::GuardCondition &condition) { return &condition; }
inline rclcpp::GuardCondition *address_of(const std::shared_ptr<rclcpp::GuardCondition> &condition) {
  return condition.get();
}

#if RCLCPP_VERSION_MAJOR < 21
/// Removes destroyed nodes and groups from the executor. Humble's rclcpp does this when it waits, and ReDAGExecutor
/// never waits there.
inline void forget_expired(rclcpp::Executor &executor) {
  struct Opened : rclcpp::Executor {
    using Executor::memory_strategy_;
    using Executor::mutex_;
    using Executor::weak_groups_associated_with_executor_to_nodes_;
    using Executor::weak_groups_to_guard_conditions_;
    using Executor::weak_groups_to_nodes_;
    using Executor::weak_groups_to_nodes_associated_with_executor_;
    using Executor::weak_nodes_;
  };
  const std::lock_guard<std::mutex> guard(executor.*(&Opened::mutex_));
  const auto is_gone = [](const auto &entry) { return entry.first.expired() || entry.second.expired(); };
  auto &conditions = executor.*(&Opened::weak_groups_to_guard_conditions_);
  for (const auto &entry : executor.*(&Opened::weak_groups_to_nodes_)) {
    if (!is_gone(entry)) continue;
    const auto condition = conditions.find(entry.first);
    if (condition == conditions.end()) continue;
    (executor.*(&Opened::memory_strategy_))->remove_guard_condition(condition->second);
    conditions.erase(condition);
  }
  std::erase_if(executor.*(&Opened::weak_groups_to_nodes_), is_gone);
  std::erase_if(executor.*(&Opened::weak_groups_to_nodes_associated_with_executor_), is_gone);
  std::erase_if(executor.*(&Opened::weak_groups_associated_with_executor_to_nodes_), is_gone);
  (executor.*(&Opened::weak_nodes_)).remove_if([](const auto &node) { return node.expired(); });
}
#endif

/// Makes get_all_callback_groups() of the executor complete: newer distributions do so in that function.
inline void update_groups(rclcpp::Executor &executor) {
#if RCLCPP_VERSION_MAJOR < 21
  struct Opened : rclcpp::Executor {
    using Executor::add_callback_groups_from_nodes_associated_to_executor;
    using Executor::mutex_;
  };
  forget_expired(executor);
  const std::lock_guard<std::mutex> guard(executor.*(&Opened::mutex_));
  (executor.*(&Opened::add_callback_groups_from_nodes_associated_to_executor))();
#else
  (void)executor;
#endif
}

/// What must stay alive while rclcpp removes a node. Humble's remove_node() throws half-way if one of the node's groups
/// is gone.
inline std::vector<rclcpp::CallbackGroup::SharedPtr> keep_groups(rclcpp::Executor &executor) {
  std::vector<rclcpp::CallbackGroup::SharedPtr> kept;
#if RCLCPP_VERSION_MAJOR < 21
  for (const auto &group : executor.get_all_callback_groups()) kept.push_back(group.lock());
  forget_expired(executor);
#else
  (void)executor;
#endif
  return kept;
}

// What the executor executes. Functions of the base class would also put all entities into its wait set, anew for each
// node. ReDAGExecutor never uses that one, and removed entities would stay there, where no other executor could wait
// for them.
#if RCLCPP_VERSION_MAJOR >= 28
inline rclcpp::executors::ExecutorEntitiesCollector &executed(rclcpp::Executor &executor) {
  struct Opened : rclcpp::Executor {
    using Executor::collector_;
  };
  return executor.*(&Opened::collector_);
}
inline void add_group(rclcpp::Executor &executor, const rclcpp::CallbackGroup::SharedPtr &group,
                      const rclcpp::node_interfaces::NodeBaseInterface::SharedPtr &) {
  executed(executor).add_callback_group(group);
}
#else
struct Executed {
  rclcpp::Executor &executor;
  void add_node(const rclcpp::node_interfaces::NodeBaseInterface::SharedPtr &node) const {
    executor.rclcpp::Executor::add_node(node, false);
  }
  void remove_node(const rclcpp::node_interfaces::NodeBaseInterface::SharedPtr &node) const {
    executor.rclcpp::Executor::remove_node(node, false);
  }
  void remove_callback_group(const rclcpp::CallbackGroup::SharedPtr &group) const {
    executor.rclcpp::Executor::remove_callback_group(group, false);
  }
};
inline Executed executed(rclcpp::Executor &executor) { return {executor}; }
inline void add_group(rclcpp::Executor &executor, const rclcpp::CallbackGroup::SharedPtr &group,
                      const rclcpp::node_interfaces::NodeBaseInterface::SharedPtr &node) {
  executor.rclcpp::Executor::add_callback_group(group, node, false);
}
#endif

}  // namespace redag_rclcpp::compat
