// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Bridge watches with a wait set what has no usable hooks: the executor's guard conditions, and members. One thread at
// a time waits; any thread may add, remove and wake.
#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <thread>
#include <vector>

#include "entities/wait_set_member.hpp"
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

  /// Makes wait() return when `condition` is triggered. `condition` must outlive the bridge.
  void watch(const rclcpp::GuardCondition &condition) { conditions_.push_back(&condition); }

  void add(std::shared_ptr<WaitSetMember> member);
  /// Stops watching `member`. On return no other thread waits for it, or holds it because of a wait. The caller may
  /// hold Registry::collect_lock_, but no other lock of this package.
  void remove(const WaitSetMember &member);
  [[nodiscard]] bool empty() const;

  /// Makes the current wait() return at once, or else the next one.
  void wake();

  /// Waits until something is ready, and tells the members concerned. A negative timeout means no limit.
  void wait(std::chrono::nanoseconds timeout);

  /// Destroys what the program dropped while a wait held it. The caller holds no lock, and is not above all jobs.
  void destroy_dropped();
  [[nodiscard]] bool has_dropped() const;

 private:
  struct Entry {
    std::shared_ptr<WaitSetMember> member;
    WaitSetMember::Held held;
  };
  void keep_dropped(std::vector<Entry> &entries);
  static void fill(rcl_wait_set_t &set, const std::vector<const rclcpp::GuardCondition *> &conditions,
                   std::vector<Entry> &entries);
  friend void find_leftovers(const rclcpp::Context::SharedPtr &context,
                             const std::vector<std::shared_ptr<WaitSetMember>> &members);

  rclcpp::Context::SharedPtr context_;
  rclcpp::GuardCondition wake_;
  std::vector<const rclcpp::GuardCondition *> conditions_;
  rcl_wait_set_t set_;

  mutable redag::PiMutex lock_;  // inherits priority: threads of all priorities add and remove
  std::vector<std::shared_ptr<WaitSetMember>> members_ REDAG_GUARDED_BY(lock_);
  std::vector<WaitSetMember::Held> dropped_ REDAG_GUARDED_BY(lock_);
  std::thread::id waiter_ REDAG_GUARDED_BY(lock_);   // thread in rcl_wait(), if any
  std::uint64_t waits_ REDAG_GUARDED_BY(lock_) = 0;  // number of waits that have begun
  redag::FutexWord left_{0};                         // number of waits that have ended
};

/// Finds messages that arrived before the hooks of these members were set and that no earlier executor took. Hooks do
/// not report such messages again.
void find_leftovers(const rclcpp::Context::SharedPtr &context,
                    const std::vector<std::shared_ptr<WaitSetMember>> &members);

}  // namespace redag_rclcpp
