// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The part of the world that only a wait set can watch: the executor's guard conditions, guard conditions of timers,
// and entities without hooks. One thread at a time waits; any thread may add, remove and wake.
#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <thread>
#include <vector>

#include "callback.hpp"
#include "rclcpp/context.hpp"
#include "rclcpp/guard_condition.hpp"
#include "redag/base/futex.hpp"
#include "redag/base/lock_guard.hpp"
#include "redag/base/pi_mutex.hpp"

namespace redag_rclcpp {

class Bridge {
 public:
  explicit Bridge(rclcpp::Context::SharedPtr context);
  ~Bridge();
  Bridge(const Bridge &) = delete;
  Bridge &operator=(const Bridge &) = delete;

  /// wait() returns when it is triggered. Outlives the bridge.
  void watch(const rclcpp::GuardCondition &condition) { conditions_.push_back(&condition); }

  void add(std::shared_ptr<Callback> callback);
  /// When this returns no other thread waits for it or holds it from a wait. Not with locks of ours held but Core's for
  /// collecting.
  void remove(const Callback &callback);
  [[nodiscard]] bool empty() const;

  /// The wait that is under way, or else the next one, returns at once.
  void wake();

  /// Waits until something is ready (negative timeout: for ever) and tells the callbacks that it concerns.
  void wait(std::chrono::nanoseconds timeout);

 private:
  struct Entry {
    std::shared_ptr<Callback> callback;
    Callback::Waited waited;
    std::size_t index = 0;  // in the wait set
  };
  static void fill(rcl_wait_set_t &set, const std::vector<const rclcpp::GuardCondition *> &conditions,
                   std::vector<Entry> &entries);
  friend void find_leftovers(const rclcpp::Context::SharedPtr &context,
                             const std::vector<std::shared_ptr<Callback>> &callbacks);

  rclcpp::Context::SharedPtr context_;
  rclcpp::GuardCondition wake_;
  std::vector<const rclcpp::GuardCondition *> conditions_;
  rcl_wait_set_t set_;

  mutable redag::PiMutex lock_;  // threads of all priorities add and remove
  std::vector<std::shared_ptr<Callback>> callbacks_ REDAG_GUARDED_BY(lock_);
  std::thread::id waiter_ REDAG_GUARDED_BY(lock_);   // of the thread in rcl_wait(), if there is one
  std::uint64_t waits_ REDAG_GUARDED_BY(lock_) = 0;  // begun
  redag::FutexWord left_{0};                         // waits that have ended
};

/// What arrived before these callbacks were attached and was not executed by who had them before: hooks do not tell of
/// it again.
void find_leftovers(const rclcpp::Context::SharedPtr &context, const std::vector<std::shared_ptr<Callback>> &callbacks);

}  // namespace redag_rclcpp
