// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// A hook of the middleware's that can be called at any time, also when what it belongs to is being destroyed.
//
// rclcpp keeps the function of set_on_new_message_callback() and its like in the Subscription, Service or Client, and
// gives the middleware its address. From Iron on their destructors no longer take it back (rclcpp pull request 2002):
// the middleware's part, it is thought, is destroyed before. But that part is shared: with QoS event handlers, with
// wait sets, with whoever asked for the handle. While one of them holds it, a message calls a function that is no more.
// So our hooks are set below rclcpp, and the middleware gets a ticket instead of an address.
#pragma once

#include <rcl/event_callback.h>
#include <rcl/types.h>

#include <cstddef>
#include <functional>
#include <memory>

#include "rclcpp/exceptions.hpp"

namespace redag_rclcpp {

/// Who is told by hooks. They hold it only weakly.
class Hooked {
 public:
  virtual ~Hooked() = default;
  /// `count` messages, requests or responses have arrived. Called by threads of the middleware with locks of its held.
  virtual void arrived_in_middleware(std::size_t count) noexcept = 0;
};

class Hook {
 public:
  Hook() = default;
  ~Hook() { clear(); }
  Hook(const Hook &) = delete;
  Hook &operator=(const Hook &) = delete;

  /// `setter` gives the entity's handle to rcl_subscription_set_on_new_message_callback or its like for services and
  /// clients. Tells at once of what arrived before. Throws as rclcpp does: the middleware has no such hook.
  template <class Entity>
  void set(const std::shared_ptr<Entity> &entity, rcl_ret_t (*setter)(Entity &, rcl_event_callback_t, const void *),
           const std::weak_ptr<Hooked> &hooked) {
    // The entity, not the handle: a weak pointer keeps the handle's deleter, which keeps the node.
    set(hooked, [weak = std::weak_ptr<Entity>(entity), setter](rcl_event_callback_t callback, const void *ticket) {
      const auto alive = weak.lock();
      return alive ? setter(*alive, callback, ticket) : RCL_RET_OK;
    });
  }
  /// From now on calls find nobody. One that is under way is waited for if the entity still exists.
  void clear();

 private:
  using Setter = std::function<rcl_ret_t(rcl_event_callback_t, const void *)>;

  void set(const std::weak_ptr<Hooked> &hooked, Setter setter);

  Setter setter_;  // empty: not set
  const void *ticket_ = nullptr;
};

}  // namespace redag_rclcpp
