// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Core implements ReDAGExecutor: it makes the parts (engine, registry of callbacks, release timer, wait set) and
// coordinates them while a spin function runs. Core knows no kind of entity, and not rclcpp::Executor (see
// ExecutorHooks).
//
// Threads: only one thread may call a spin function at a time; ReDAGExecutor sees to it. While spin() runs, the thread
// redag-wait, with os above all jobs, waits for the wait set. The thread that called spin() collects entities and ends
// learning, at its own priority. Any thread may call the rest. registry.hpp states the lock order.
#pragma once

#include <atomic>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "entities/bridge.hpp"
#include "entities/callback.hpp"
#include "learning.hpp"
#include "redag/base/lock_guard.hpp"
#include "redag/base/pi_mutex.hpp"
#include "redag/runtime/watchdog.hpp"
#include "redag/threads/parker.hpp"
#include "redag/threads/setup.hpp"
#include "redag_rclcpp/executor.hpp"
#include "registry.hpp"
#include "release_timer.hpp"
#include "task_table.hpp"
#include "watch/deadlock_watch.hpp"
#include "watch/middleware_watch.hpp"
#include "watch/notes.hpp"

namespace redag_rclcpp {

/// What Core uses of the rclcpp::Executor around it.
struct ExecutorHooks {
  Registry::Groups groups;         // all groups that are to be executed
  std::function<bool()> may_spin;  // false: cancelled or shut down
  std::function<void()> stop;      // cancel()
};

class ReDAGExecutor::Core final : public ExecutorContext, public std::enable_shared_from_this<Core> {
 public:
  Core(const rclcpp::Context::SharedPtr &context, ReDAGOptions options);
  ~Core() override;

  void open(ExecutorHooks hooks, const std::vector<const rclcpp::GuardCondition *> &conditions);
  /// Disconnects everything and ends all threads. Must be called before the executor's own members are destroyed.
  void close();

  /// Nodes, groups and their callbacks.
  [[nodiscard]] Registry &registry() { return registry_; }

  /// Begins a spin. False, for the first spin only: cancel() was called before it, which rclcpp would forget.
  [[nodiscard]] bool begin_first_spin() { return first_spin_.exchange(FirstSpin::Begun) != FirstSpin::Cancelled; }
  void cancel_first_spin() {
    FirstSpin expected = FirstSpin::Awaited;
    first_spin_.compare_exchange_strong(expected, FirstSpin::Cancelled);
  }

  /// Starts no further callbacks until the next spin.
  void start_no_more();

  void spin();
  void spin_ready(std::chrono::nanoseconds max_duration, bool exhaustive);
  void spin_one(std::chrono::nanoseconds timeout);

  [[nodiscard]] const redag::runtime::Setup &setup() const { return setup_; }
  [[nodiscard]] const TaskTable &tasks() const { return tasks_; }
  [[nodiscard]] std::vector<std::string> warnings() const;
  [[nodiscard]] std::vector<std::string> errors() const;
  [[nodiscard]] std::vector<Deadlock> deadlocks() const { return notes_.deadlocks(); }
  [[nodiscard]] bool learning_done() const { return learning_.done(); }
  [[nodiscard]] redag::trace::RunInfo run_info(std::vector<std::uint32_t> &positions) const;

  // Functions of ExecutorContext.
  redag::runtime::Engine &engine() override { return *engine_; }
  TimerQueue &timers() override { return timer_.queue(); }
  [[nodiscard]] bool direct() const override { return direct_; }
  void note(std::shared_ptr<Callback> callback) override;
  void wake() override;
  void timers_changed() override;
  void wait_set_changed() override;
  void look_for_leftovers(const std::shared_ptr<Callback> &callback) override;
  void exchange_arrived() override;
  void entities_changed() override;
  [[nodiscard]] redag::Duration learning_time() const override { return learning_.time(); }
  void rate_seen() override;
  void let_wait() override;
  [[nodiscard]] redag::runtime::DeviceHandle device(const std::string &name) const override;

 private:
  void start();
  void watch_jobs();
  void report_unmatched();
  void keep_house(MiddlewareWatch *middleware);
  void watch_wait_set() noexcept;
  void stop_workers();
  void admit(bool look_around);
  void admit_noted();
  bool run_one();
  void on_exception(const redag::runtime::Job &job, std::exception_ptr exception);

  rclcpp::Context::SharedPtr context_;
  const ReDAGOptions options_;
  ExecutorHooks hooks_;
  rclcpp::OnShutdownCallbackHandle shutdown_;
  redag::runtime::Setup setup_;
  const redag::Time origin_;  // zero of the engine's clock, on CLOCK_MONOTONIC
  Notes notes_;
  std::unique_ptr<redag::runtime::Engine> engine_;
  ReleaseTimer timer_;
  Bridge bridge_;
  TaskTable tasks_;
  Registry registry_;
  Learning learning_;
  DeadlockWatch deadlock_watch_;

  enum class FirstSpin : std::uint8_t { Awaited, Cancelled, Begun };
  std::atomic<FirstSpin> first_spin_{FirstSpin::Awaited};

  std::atomic<bool> direct_{false};
  redag::Time report_unmatched_at_ = redag::kNever;
  std::string middleware_summary_;  // what the log says last about the middleware's threads
  bool started_ = false;
  std::string start_error_;  // why the engine could not start; stays set

  redag::PiMutex let_wait_lock_;
  std::atomic<bool> lets_wait_{false};  // written under that lock

  redag::PiMutex noted_lock_;
  std::vector<std::shared_ptr<Callback>> noted_ REDAG_GUARDED_BY(noted_lock_);
  std::atomic<bool> waiting_{false};  // a spin function that pulls is waiting for work

  redag::runtime::Parker keeper_parker_;    // wakes the thread in keep_house()
  std::atomic<bool> wait_set_done_{false};  // watch_wait_set() has ended, or must end
  std::exception_ptr wait_set_failure_;     // exception of watch_wait_set(), read after its end

  std::unique_ptr<redag::runtime::Watchdog> watchdog_;  // set once the engine has threads
};

}  // namespace redag_rclcpp
