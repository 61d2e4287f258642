// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Hook is a hook of the middleware that may be called at any time, even while its entity is being destroyed.
//
// rclcpp stores the function of set_on_new_message_callback() and its like in the Subscription, Service or Client, and
// gives the middleware its address. Since Iron the destructors no longer take the address back (rclcpp pull request
// 2002), on the assumption that the middleware's part is destroyed earlier. But QoS event handlers, wait sets and users
// who asked for the handle share that part. While one of them holds it, a message calls a function that no longer
// exists. Hook is therefore set below rclcpp, and gives the middleware a ticket instead of an address.
#pragma once

#include <rcl/event_callback.h>
#include <rcl/types.h>

#include <cstddef>
#include <functional>
#include <memory>

#include "rclcpp/exceptions.hpp"

namespace redag_rclcpp {

/// Receives the calls of hooks, which hold it only weakly.
class Hooked {
 public:
  virtual ~Hooked() = default;
  /// `count` messages, requests or responses have arrived. The middleware's threads call this with locks of their own
  /// held.
  virtual void arrived_in_middleware(std::size_t count) noexcept = 0;
};

class Hook {
 public:
  /// `stays`: clear() leaves a hook that does nothing in the entity.
  explicit Hook(bool stays = false) : stays_(stays) {}
  ~Hook() { clear(); }
  Hook(const Hook &) = delete;
  Hook &operator=(const Hook &) = delete;

  /// Sets the hook. `setter` gives the entity's handle to rcl_subscription_set_on_new_message_callback or its like for
  /// services and clients. Earlier arrivals are reported at once. Throws, as rclcpp does, if the middleware has no such
  /// hook.
  template <class Entity>
  void set(const std::shared_ptr<Entity> &entity, rcl_ret_t (*setter)(Entity &, rcl_event_callback_t, const void *),
           const std::weak_ptr<Hooked> &hooked) {
    // Captures the entity, not the handle: a weak pointer to the handle keeps its deleter, which keeps the node.
    set(hooked, [weak = std::weak_ptr<Entity>(entity), setter](rcl_event_callback_t callback, const void *ticket) {
      const auto alive = weak.lock();
      return alive ? setter(*alive, callback, ticket) : RCL_RET_OK;
    });
  }
  /// Disconnects: later calls have no effect. Waits for a call in progress if the entity still exists.
  void clear();

 private:
  using Setter = std::function<rcl_ret_t(rcl_event_callback_t, const void *)>;

  void set(const std::weak_ptr<Hooked> &hooked, Setter setter);

  const bool stays_;
  Setter setter_;  // empty: no hook is set
  const void *ticket_ = nullptr;
};

}  // namespace redag_rclcpp
