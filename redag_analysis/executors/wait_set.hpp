// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Models rclcpp's executors that wait for a set of entities, as of ROS 2 Humble: SingleThreadedExecutor,
// MultiThreadedExecutor, StaticSingleThreadedExecutor. Decides which ready job runs next. The class says what is
// modelled and what is not. Not thread-safe.
#pragma once

#include <cstdint>
#include <vector>

#include "redag/sched/lifecycle.hpp"
#include "redag_analysis/executors/callback_threads.hpp"
#include "redag_analysis/executors/ready_jobs.hpp"

namespace redag::executors {

/// Modelled (rclcpp/src/rclcpp/executor.cpp and allocator_memory_strategy.hpp):
/// - A wait returns the set of ready entities (Executor::wait_for_work, collect_entities, remove_null_handles).
///   Entities of an exclusive group that is busy are left out. This set is used up before the next wait, and what
///   becomes ready meanwhile is not seen. This is the processing window of Casini, Blass, Luetkebohle, Brandenburg,
///   ECRTS 2019.
/// - From the set timers go first, then subscriptions (get_next_ready_executable_from_map), in the order of
///   registration, each once. Those whose group is busy are passed over and stay (get_next_timer,
///   get_next_subscription).
/// - StaticSingleThreadedExecutor walks through the set in the same way, but takes subscriptions first, then timers
///   (rclcpp/src/rclcpp/executors/static_single_threaded_executor.cpp, execute_ready_executables).
/// - MultiThreadedExecutor::run: the threads take one entity each under a lock; a group is busy until its job ends.
///
/// Not modelled: the cost of rcl_wait, of the lock and of waking a thread; services, clients and waitables. ROS 2 walks
/// through groups in the arbitrary order of their addresses (here: `ranks`, or the order of DAGs and tasks). The static
/// executor takes messages within the process last, even if they came during the walk. Jazzy's static executor waits
/// again after each callback; a ready subscription thus always goes before every timer.
///
/// A timer task is a timer, a data task a subscription. `group` is the callback group. A task without one is alone in a
/// group of its own, whereas in ROS 2 all callbacks of a node share its default group unless the node says
/// otherwise. These executors do not know max_active, priorities and preemption.
class WaitSetDispatcher {
 public:
  static constexpr bool kEnforcesLimits = false;

  enum class Order : std::uint8_t { TimersFirst, SubscriptionsFirst };

  /// Requires config.workers > 0 and Preemption::None. With 1 worker it is the SingleThreadedExecutor or, with
  /// subscriptions first, the static one. `ranks` of tasks, if there are any, replace the order of registration.
  WaitSetDispatcher(sched::JobTable &table, Order order, std::vector<std::uint32_t> ranks = {});

  void on_ready(std::uint32_t slot);
  void on_withdrawn(std::uint32_t slot);
  void on_end(std::uint32_t slot);
  void on_lowered(std::uint32_t /*slot*/) {}
  void on_reconfigured();
  void on_preemption_point(std::uint32_t /*slot*/) {}
  void decide(std::uint32_t most);
  [[nodiscard]] bool outranked(const sched::Job & /*job*/) const { return false; }
  [[nodiscard]] bool is_idle() const { return true; }

 private:
  /// A task as rclcpp sees it: a timer or a subscription.
  struct Entity {
    ReadyJobs ready;
    std::uint32_t group = 0;  // position in room_
    bool in_window = false;
  };

  std::uint32_t take();
  std::uint32_t take_from_window();
  bool wait();

  sched::JobTable &table_;
  CallbackThreads threads_;
  Order order_;
  std::vector<std::uint32_t> ranks_;         // by TaskId
  std::vector<Entity> entities_;             // by TaskId
  std::vector<std::uint32_t> registration_;  // tasks in the order in which a window is searched
  std::vector<std::uint32_t> room_;          // number of jobs that a group can start: one group for each task, then the
                                             // named ones
};

using WaitSetScheduler = sched::Lifecycle<WaitSetDispatcher>;

}  // namespace redag::executors
