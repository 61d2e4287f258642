// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// WaitSetMember is what a wait set watches: an entity without a usable hook, the guard condition of a timer, or an
// entity that is searched for messages from before its hook was set. It knows how its kind is waited for. Bridge fills
// the wait sets.
#pragma once

#include <rcl/wait.h>

#include <cstddef>
#include <memory>

#include "rclcpp/exceptions.hpp"
#include "rclcpp/waitable.hpp"

namespace redag_rclcpp {

/// The numbers of entities that rcl_wait_set_resize() takes.
struct WaitSetSizes {
  std::size_t subscriptions = 0;
  std::size_t guard_conditions = 0;
  std::size_t timers = 0;
  std::size_t clients = 0;
  std::size_t services = 0;
  std::size_t events = 0;

  void add(rclcpp::Waitable &waitable) {
    subscriptions += waitable.get_number_of_ready_subscriptions();
    guard_conditions += waitable.get_number_of_ready_guard_conditions();
    timers += waitable.get_number_of_ready_timers();
    clients += waitable.get_number_of_ready_clients();
    services += waitable.get_number_of_ready_services();
    events += waitable.get_number_of_ready_events();
  }
};

/// Throws, as rclcpp does, if a call of rcl failed.
inline void check_rcl(rcl_ret_t result, const char *what) {
  if (result != RCL_RET_OK) rclcpp::exceptions::throw_from_rcl_error(result, what);
}

class WaitSetMember {
 public:
  virtual ~WaitSetMember() = default;

  /// Keeps the entity alive as long as a wait set names it. The types are the member's own business.
  struct Held {
    std::shared_ptr<void> entity{};  // null: there is nothing to watch
    std::shared_ptr<void> part{};    // that belongs to the entity, if any
    std::size_t index = 0;           // of the entity in the wait set
  };

  /// What a wait set must watch. Nothing while an arrival that the wait set saw has not been handled.
  [[nodiscard]] virtual Held watched() const = 0;
  /// The entity, if hooks report its arrivals.
  [[nodiscard]] virtual Held hooked() const = 0;

  // `held` is what watched() or hooked() returned.
  virtual void count(const Held &held, WaitSetSizes &sizes) const = 0;
  virtual void add(Held &held, rcl_wait_set_t &set) const = 0;
  [[nodiscard]] virtual bool is_ready(const Held &held, rcl_wait_set_t &set) const = 0;

  /// Releases a job for what the wait set saw.
  virtual void seen_by_wait_set() = 0;
  /// Releases jobs until nothing is left, if the entity holds messages that no hook may have reported. `any`: rcl_wait
  /// found anything ready.
  virtual void take_leftovers(const Held &held, rcl_wait_set_t &set, bool any) = 0;
};

}  // namespace redag_rclcpp
