// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "bridge.hpp"

#include <rcl/wait.h>

#include <algorithm>
#include <climits>
#include <utility>

#include "compat.hpp"
#include "rclcpp/exceptions.hpp"

namespace redag_rclcpp {
namespace {

void check(rcl_ret_t result, const char *what) {
  if (result != RCL_RET_OK) rclcpp::exceptions::throw_from_rcl_error(result, what);
}

}  // namespace

Bridge::Bridge(rclcpp::Context::SharedPtr context)
    : context_(std::move(context)), wake_(context_), set_(rcl_get_zero_initialized_wait_set()) {
  check(rcl_wait_set_init(&set_, 0, 1, 0, 0, 0, 0, context_->get_rcl_context().get(), rcl_get_default_allocator()),
        "cannot create a wait set");
  watch(wake_);
}

Bridge::~Bridge() {
  if (rcl_wait_set_fini(&set_) != RCL_RET_OK) rcl_reset_error();
}

void Bridge::add(std::shared_ptr<Callback> callback) {
  {
    const redag::LockGuard guard(lock_);
    callbacks_.push_back(std::move(callback));
  }
  wake();
}

// Waits until no other thread waits for the callback, because it may be attached again at once. With Cyclone DDS,
// setting a subscription's hook can deadlock with a beginning wait for one of its QoS events. The hook holds the
// middleware's lock and wants the reader's. The wait holds the reader's lock and waits for a listener, which wants the
// middleware's lock.
void Bridge::remove(const Callback &callback) {
  std::uint64_t begun = 0;
  {
    const redag::LockGuard guard(lock_);
    const auto found =
        std::find_if(callbacks_.begin(), callbacks_.end(), [&](auto &c) { return c.get() == &callback; });
    if (found == callbacks_.end()) return;
    *found = std::move(callbacks_.back());
    callbacks_.pop_back();
    begun = waits_;
  }
  wake();
  for (;;) {
    const std::uint32_t left = left_.load();
    {
      const redag::LockGuard guard(lock_);
      if (waiter_ == std::thread::id() || waiter_ == std::this_thread::get_id() || waits_ != begun) return;
    }
    redag::futex_wait(left_, left);
  }
}

bool Bridge::empty() const {
  const redag::LockGuard guard(lock_);
  return callbacks_.empty();
}

void Bridge::wake() {
  try {
    wake_.trigger();
  } catch (const rclcpp::exceptions::RCLError &) {
    // The context was shut down, which wakes the waiting thread anyway.
  }
}

void Bridge::wait(std::chrono::nanoseconds timeout) {
  // Declared before `entries`, hence destroyed after it: a thread in remove() still owns the callback when `entries`
  // releases it. Otherwise this thread, which is more urgent than all jobs, could be the one to destroy it.
  const struct Leave {
    ~Leave() {
      {
        const redag::LockGuard guard(bridge.lock_);
        bridge.waiter_ = {};
      }
      bridge.left_.fetch_add(1);
      redag::futex_wake(bridge.left_, INT_MAX);
    }
    Bridge &bridge;
  } leave{*this};
  std::vector<Entry> entries;
  {
    const redag::LockGuard guard(lock_);
    for (const auto &callback : callbacks_) entries.push_back(Entry{callback, callback->waited()});
    waiter_ = std::this_thread::get_id();
    ++waits_;
  }
  fill(set_, conditions_, entries);
  const rcl_ret_t result = rcl_wait(&set_, timeout.count() < 0 ? -1 : timeout.count());
  if (result == RCL_RET_TIMEOUT) return;
  check(result, "waiting failed");

  for (Entry &entry : entries) {
    const auto &waited = entry.waited;
    if (waited.timer) {
      if (set_.guard_conditions[entry.index] != nullptr) entry.callback->look_at_timer();
      continue;
    }
    const bool ready = (waited.subscription && set_.subscriptions[entry.index] != nullptr) ||
                       (waited.service && set_.services[entry.index] != nullptr) ||
                       (waited.client && set_.clients[entry.index] != nullptr) ||
                       (waited.waitable && compat::is_ready(*waited.waitable, set_));
    if (ready) entry.callback->seen_by_wait_set();
  }
}

void Bridge::fill(rcl_wait_set_t &set, const std::vector<const rclcpp::GuardCondition *> &conditions,
                  std::vector<Entry> &entries) {
  std::size_t subscriptions = 0;
  std::size_t guard_conditions = conditions.size();
  std::size_t timers = 0;
  std::size_t clients = 0;
  std::size_t services = 0;
  std::size_t events = 0;
  for (const Entry &entry : entries) {
    guard_conditions += entry.waited.timer != nullptr;
    subscriptions += entry.waited.subscription != nullptr;
    services += entry.waited.service != nullptr;
    clients += entry.waited.client != nullptr;
    if (const auto &waitable = entry.waited.waitable) {
      subscriptions += waitable->get_number_of_ready_subscriptions();
      guard_conditions += waitable->get_number_of_ready_guard_conditions();
      timers += waitable->get_number_of_ready_timers();
      clients += waitable->get_number_of_ready_clients();
      services += waitable->get_number_of_ready_services();
      events += waitable->get_number_of_ready_events();
    }
  }
  check(rcl_wait_set_clear(&set), "cannot clear the wait set");
  check(rcl_wait_set_resize(&set, subscriptions, guard_conditions, timers, clients, services, events),
        "cannot resize the wait set");
  for (const rclcpp::GuardCondition *condition : conditions) {
    check(rcl_wait_set_add_guard_condition(&set, &condition->get_rcl_guard_condition(), nullptr),
          "cannot wait for a guard condition");
  }
  for (Entry &entry : entries) {
    const auto &waited = entry.waited;
    if (waited.timer) {
      check(rcl_wait_set_add_guard_condition(&set, rcl_timer_get_guard_condition(waited.timer.get()), &entry.index),
            "cannot wait for a timer's guard condition");
    }
    if (waited.subscription) {
      check(rcl_wait_set_add_subscription(&set, waited.subscription->get_subscription_handle().get(), &entry.index),
            "cannot wait for a subscription");
    }
    if (waited.service) {
      check(rcl_wait_set_add_service(&set, waited.service->get_service_handle().get(), &entry.index),
            "cannot wait for a service");
    }
    if (waited.client) {
      check(rcl_wait_set_add_client(&set, waited.client->get_client_handle().get(), &entry.index),
            "cannot wait for a client");
    }
    if (waited.waitable) compat::add_to_wait_set(*waited.waitable, set);
  }
}

void find_leftovers(const rclcpp::Context::SharedPtr &context,
                    const std::vector<std::shared_ptr<Callback>> &callbacks) {
  std::vector<Bridge::Entry> entries;
  for (const auto &callback : callbacks) {
    const Callback::Waited waited = callback->hooked();
    if (waited.subscription || waited.service || waited.client) entries.push_back({callback, waited});
  }
  if (entries.empty()) return;
  rcl_wait_set_t set = rcl_get_zero_initialized_wait_set();
  check(rcl_wait_set_init(&set, 0, 0, 0, 0, 0, 0, context->get_rcl_context().get(), rcl_get_default_allocator()),
        "cannot create a wait set");
  const std::unique_ptr<rcl_wait_set_t, void (*)(rcl_wait_set_t *)> owner(&set, [](rcl_wait_set_t *finished) {
    if (rcl_wait_set_fini(finished) != RCL_RET_OK) rcl_reset_error();
  });
  Bridge::fill(set, {}, entries);
  const rcl_ret_t result = rcl_wait(&set, 0);
  if (result != RCL_RET_TIMEOUT) check(result, "looking for messages failed");
  for (const Bridge::Entry &entry : entries) {
    const auto &waited = entry.waited;
    const bool ready = (waited.subscription && set.subscriptions[entry.index] != nullptr) ||
                       (waited.service && set.services[entry.index] != nullptr) ||
                       (waited.client && set.clients[entry.index] != nullptr);
    entry.callback->take_leftovers(result == RCL_RET_OK && ready,
                                   waited.waitable && compat::is_ready(*waited.waitable, set));
  }
}

}  // namespace redag_rclcpp
