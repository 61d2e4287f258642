// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Core implements ReDAGExecutor: the engine with its scheduler, the callbacks of all groups, and the threads that
// release their jobs. Core knows rclcpp's entities, but not rclcpp::Executor (see ExecutorHooks).
//
// Threads: collect_lock_ serialises collect(). Only one thread may call a spin function at a time; ReDAGExecutor sees
// to it. While spin() runs, the thread redag-wait, with os above all jobs, waits for the wait set. The thread that
// called spin() collects entities and ends learning, at its own priority. Any thread may call hooks. Lock order:
// collect_lock_, rclcpp's, the callbacks', the timer queue's, the engine's.
#pragma once

#include <atomic>
#include <map>
#include <memory>
#include <string>
#include <thread>
#include <unordered_map>
#include <vector>

#include "bridge.hpp"
#include "callback.hpp"
#include "middleware_threads.hpp"
#include "rclcpp/callback_group.hpp"
#include "recursive_mutex.hpp"
#include "redag/base/lock_guard.hpp"
#include "redag/base/pi_mutex.hpp"
#include "redag/live/publisher.hpp"
#include "redag/runtime/parker.hpp"
#include "redag/runtime/setup.hpp"
#include "redag/runtime/watchdog.hpp"
#include "redag_rclcpp/executor.hpp"
#include "task_table.hpp"
#include "timer_queue.hpp"

namespace redag_rclcpp {

using NodeBase = rclcpp::node_interfaces::NodeBaseInterface;

/// What Core uses of the rclcpp::Executor around it.
struct ExecutorHooks {
  std::function<std::vector<rclcpp::CallbackGroup::WeakPtr>()> groups;  // all groups that are to be executed
  std::function<bool()> may_spin;                                       // false: cancelled or shut down
  std::function<void()> stop;                                           // as rclcpp's cancel()
};

class ReDAGExecutor::Core final : public ExecutorContext, public std::enable_shared_from_this<Core> {
 public:
  Core(const rclcpp::Context::SharedPtr &context, ReDAGOptions options);
  ~Core() override;

  void open(ExecutorHooks hooks, const std::vector<const rclcpp::GuardCondition *> &conditions);
  /// Disconnects everything and ends all threads. Must be called before the executor's own members are destroyed.
  void close();

  /// Runs `change` as one step: a thread that collects sees all of it or nothing. `change` tells rclcpp and Core (by
  /// add_node(), remove_node(), add_group(), remove_group()) what is to be executed. Then collects.
  void change(const std::function<void()> &change);
  void add_node(const NodeBase::SharedPtr &node);
  void remove_node(const NodeBase::SharedPtr &node);
  /// Holds `instance` until the callbacks of the node are gone and have ended. Call it before remove_node().
  void keep_until_done(NodeBase &node, const std::shared_ptr<void> &instance);
  void add_group(const rclcpp::CallbackGroup::SharedPtr &group, const NodeBase::SharedPtr &node);
  void remove_group(const rclcpp::CallbackGroup::SharedPtr &group);

  /// Adds and removes tasks until they match the entities in the groups.
  void collect();

  /// Begins a spin. False, for the first spin only: cancel() was called before it, which rclcpp would forget.
  [[nodiscard]] bool begin_first_spin() { return first_spin_.exchange(FirstSpin::Begun) != FirstSpin::Cancelled; }
  void cancel_first_spin() {
    FirstSpin expected = FirstSpin::Awaited;
    first_spin_.compare_exchange_strong(expected, FirstSpin::Cancelled);
  }

  void spin();
  void spin_ready(std::chrono::nanoseconds max_duration, bool exhaustive);
  void spin_one(std::chrono::nanoseconds timeout);

  [[nodiscard]] const redag::runtime::Setup &setup() const { return setup_; }
  [[nodiscard]] const TaskTable &tasks() const { return tasks_; }
  [[nodiscard]] std::vector<std::string> warnings() const;
  [[nodiscard]] bool learning_done() const { return !learning_; }
  void set_live_bounds(std::map<std::string, redag::Duration> bounds);
  [[nodiscard]] redag::trace::RunInfo run_info(std::vector<std::uint32_t> &positions) const;

  // Functions of ExecutorContext.
  redag::runtime::Engine &engine() override { return *engine_; }
  TimerQueue &timers() override { return timers_; }
  [[nodiscard]] bool direct() const override { return direct_; }
  void note(std::shared_ptr<Callback> callback) override;
  void wake() override;
  void timers_changed() override;
  void wait_set_changed() override;
  [[nodiscard]] bool learning() const override { return learning_; }

 private:
  struct Entity;

  void forget_gone_nodes() REDAG_REQUIRES(collect_lock_);
  void add(const Entity &found) REDAG_REQUIRES(collect_lock_);
  void remove(const std::shared_ptr<Callback> &callback) REDAG_REQUIRES(collect_lock_);
  void place(TaskTable::Entry &entry, const Entity &found) REDAG_REQUIRES(collect_lock_);
  void watch_group(rclcpp::CallbackGroup &group, const std::function<void(std::size_t)> &callback);
  [[nodiscard]] std::vector<Entity> find_entities() REDAG_REQUIRES(collect_lock_);
  [[nodiscard]] std::string group_name(const rclcpp::CallbackGroup::SharedPtr &group) REDAG_REQUIRES(collect_lock_);

  void go_live();
  void start();
  void note_middleware(const RaisedMiddleware &raised);
  void note_warning(const std::string &warning);
  void lock_memory();
  void watch_jobs();
  void report_unmatched();
  void keep_house();
  void watch_wait_set() noexcept;
  void stop_workers();
  void time_releases() noexcept;
  redag::Time expire_timers();
  void admit(bool look_around);
  void admit_noted();
  bool run_one();
  void mark_dirty();
  void on_exception(const redag::runtime::Job &job, std::exception_ptr exception);
  void throw_failure();
  void begin_learning();
  void stop_learning();

  rclcpp::Context::SharedPtr context_;
  const ReDAGOptions options_;
  ExecutorHooks hooks_;
  redag::runtime::Setup setup_;
  redag::Time origin_ = 0;  // zero of the engine's clock, on CLOCK_MONOTONIC
  std::unique_ptr<redag::runtime::Engine> engine_;
  TimerQueue timers_;
  Bridge bridge_;
  TaskTable tasks_;
  std::vector<redag::DagId> dag_ids_;  // ids of tasks_.dags()

  template <class T>
  using ByGroup = std::map<rclcpp::CallbackGroup::WeakPtr, T, std::owner_less<rclcpp::CallbackGroup::WeakPtr>>;

  mutable RecursiveMutex collect_lock_;  // recursive: destructors of users' objects run while it is held
  std::unique_ptr<redag::CallbackMatcher> matcher_ REDAG_PT_GUARDED_BY(collect_lock_);  // null: no workload
  std::vector<NodeBase::WeakPtr> nodes_ REDAG_GUARDED_BY(collect_lock_);
  std::map<const void *, std::shared_ptr<Callback>> callbacks_ REDAG_GUARDED_BY(collect_lock_);  // by entity
  ByGroup<std::string> group_names_ REDAG_GUARDED_BY(collect_lock_);
  ByGroup<NodeBase::WeakPtr> manual_groups_ REDAG_GUARDED_BY(collect_lock_);
  // Next index of a timer or waitable, by node and kind.
  std::map<std::pair<std::string, int>, std::uint32_t> next_index_ REDAG_GUARDED_BY(collect_lock_);
  std::uint64_t next_group_ REDAG_GUARDED_BY(collect_lock_) = 0;

  mutable redag::PiMutex notes_lock_;  // innermost lock
  std::vector<std::string> warnings_ REDAG_GUARDED_BY(notes_lock_);
  std::exception_ptr failure_ REDAG_GUARDED_BY(notes_lock_);
  std::map<std::string, redag::Duration> live_bounds_ REDAG_GUARDED_BY(notes_lock_);

  enum class FirstSpin : std::uint8_t { Awaited, Cancelled, Begun };
  std::atomic<FirstSpin> first_spin_{FirstSpin::Awaited};

  std::atomic<bool> dirty_{true};
  std::atomic<bool> direct_{false};
  std::atomic<bool> learning_{false};
  redag::Time learn_until_ = redag::kNever;
  redag::Time report_unmatched_at_ = redag::kNever;
  bool started_ = false;
  std::string start_error_;  // why the engine could not start; stays set
  bool closed_ REDAG_GUARDED_BY(collect_lock_) = false;

  redag::PiMutex noted_lock_;
  std::vector<std::shared_ptr<Callback>> noted_ REDAG_GUARDED_BY(noted_lock_);
  std::atomic<bool> waiting_{false};  // a spin function that pulls is waiting for work

  redag::runtime::Parker keeper_parker_;    // wakes the thread in keep_house()
  std::atomic<bool> wait_set_done_{false};  // watch_wait_set() has ended, or must end
  std::exception_ptr wait_set_failure_;     // exception of watch_wait_set(), read after its end

  std::thread timer_thread_;
  redag::runtime::Parker timer_parker_;
  std::atomic<bool> timing_{false};
  std::atomic<bool> timer_exit_{false};
  redag::PiMutex expire_lock_;  // held by the timer thread, or by the thread that pulls
  std::vector<redag::runtime::Release> due_ REDAG_GUARDED_BY(expire_lock_);
  std::vector<redag::runtime::Release> missed_ REDAG_GUARDED_BY(expire_lock_);

  std::unique_ptr<redag::runtime::Watchdog> watchdog_;  // set once the engine has threads

  std::unique_ptr<redag::live::Publisher> live_;  // last member: it reads figures until it is destroyed
};

}  // namespace redag_rclcpp
