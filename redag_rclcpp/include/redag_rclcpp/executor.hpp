// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// ReDAG-RT as an rclcpp executor: executes the callbacks of all its nodes in one global order, most urgent first, by
// the library's scheduler. Takes the place of rclcpp::executors::MultiThreadedExecutor; docs/ros2.md says what changes.
//
// Threads: as rclcpp's executors. Everything may be called while spinning and from callbacks, except the spin functions
// (which throw until the one before has returned, also where that was cancelled).
#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <exception>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "rclcpp/executor.hpp"
#include "rclcpp/version.h"
#include "redag/model/callback_match.hpp"
#include "redag/model/workload.hpp"
#include "redag/runtime/engine.hpp"
#include "redag/runtime/setup.hpp"
#include "redag/trace/trace.hpp"

namespace redag_rclcpp {

/// An exception that left a callback.
struct ExceptionInfo {
  std::string task;  // "control.ekf", or the callback's own description
  std::exception_ptr exception;
};

enum class OnException : std::uint8_t {
  Stop,      // spinning ends as by cancel(), and the spin function throws the first such exception
  Continue,  // the job counts as aborted, nothing else happens
};

struct ReDAGOptions {
  std::uint32_t workers = 0;  // callbacks that execute at the same time; 0: one a usable processor
  redag::PreemptionMode preemption = redag::PreemptionMode::Auto;
  redag::PolicyKind policy = redag::PolicyKind::RateMonotonic;
  redag::Ties ties = redag::Ties::Share;  // callbacks of equal priority: the earlier release first, or a fixed order
  std::uint32_t threads = 0;              // os: callbacks that can be started and unfinished at once; 0: workers + 16
  std::vector<int> cpus{};                // processors for the workers; empty: os takes `workers` of the usable ones

  /// Which callback is which task of which DAG (docs/workload_format.md, `callback`). Platform and policy of the
  /// workload are not read here: see load_options().
  std::optional<redag::Workload> workload{};
  /// Period of what neither the workload nor a timer gives one; decides its priority until it is learned. Above 0.
  std::chrono::nanoseconds default_period = std::chrono::milliseconds(100);
  /// Rates and edges are learned for so long after the first spin, and then frozen; 0: not at all.
  std::chrono::nanoseconds learn = std::chrono::nanoseconds(0);

  /// os: threads of the middleware that deliver messages are given a higher priority than the workers, where they are
  /// known (Cyclone DDS, Fast DDS). Otherwise busy workers could delay the very messages they wait for.
  bool raise_middleware = true;
  /// Locks the memory of the process as it is used, and touches the stacks of the threads beforehand, so that callbacks
  /// meet no page fault there. If it cannot be had, warnings() says so.
  bool lock_memory = false;
  /// none, cooperative: how long an idle worker looks for a job before it sleeps.
  std::chrono::nanoseconds spin{};
  /// Callbacks that are in progress for longer are named by a warning while they are; 0: none. With it, `on_budget` and
  /// HI mode also take effect in callbacks without preemption points.
  std::chrono::nanoseconds watchdog{};
  std::size_t trace_capacity = 0;  // events kept between two drain_trace(); 0: none are recorded
  bool live = false;               // `redag top` sees it: a page of shared memory, and a thread that updates it
  /// Called on the worker's thread; must not throw. Empty: Stop.
  std::function<OnException(const ExceptionInfo &)> on_exception{};
};

/// What one callback did since it was added.
struct CallbackStats {
  redag::CallbackId id;
  std::string dag;             // "" if the workload does not name it
  std::string task;            // "control.ekf", or to_string(id)
  redag::Duration period = 0;  // for its priority; of a timer or the workload, or learned, or the default
  redag::Duration deadline = 0;
  redag::Duration wcet = 0;          // as the workload states it; 0: not stated
  redag::sched::Accounting jobs;     // skipped: releases that were missed or overwritten before they could start
  std::uint64_t misses = 0;          // ended after the deadline, or never started
  redag::Duration response_p50 = 0;  // from the release (timer: expected call; message: arrival) to the end
  redag::Duration response_p99 = 0;
  redag::Duration response_max = 0;
  redag::Duration execution_p50 = 0;  // processor time
  redag::Duration execution_p99 = 0;
  redag::Duration execution_max = 0;
};

class ReDAGExecutor : public rclcpp::Executor {
 public:
  RCLCPP_SMART_PTR_DEFINITIONS(ReDAGExecutor)

  /// Throws std::runtime_error if preemption `os` is asked for and cannot be had (the text says how to get it), or
  /// if the workload is not valid.
  explicit ReDAGExecutor(const rclcpp::ExecutorOptions &options = rclcpp::ExecutorOptions(),
                         ReDAGOptions redag_options = ReDAGOptions());
  explicit ReDAGExecutor(ReDAGOptions redag_options);
  ~ReDAGExecutor() override;

  /// Executes callbacks on the workers until cancel() or shutdown, and returns when those that had started have ended.
  /// Throws the first exception of a callback (see ReDAGOptions::on_exception).
  void spin() override;
  // On the calling thread, one callback at a time, most urgent first.
  void spin_some(std::chrono::nanoseconds max_duration = std::chrono::nanoseconds(0)) override;
  void spin_all(std::chrono::nanoseconds max_duration) override;
  void spin_once(std::chrono::nanoseconds timeout = std::chrono::nanoseconds(-1)) override;

  /// As rclcpp's. Before the very first spin it makes that one return at once (rclcpp forgets it).
#if RCLCPP_VERSION_MAJOR >= 28
  void cancel() override;
#else
  void cancel();
#endif

  using rclcpp::Executor::add_node;
  using rclcpp::Executor::remove_node;
  void add_node(rclcpp::node_interfaces::NodeBaseInterface::SharedPtr node, bool notify = true) override;
  void remove_node(rclcpp::node_interfaces::NodeBaseInterface::SharedPtr node, bool notify = true) override;
  /// Removes the node and holds `instance`, the object whose members its callbacks use, until those in progress have
  /// ended; then destroys it, unless others hold it, too. remove_node() waits for no callback.
  void retire_node(const rclcpp::node_interfaces::NodeBaseInterface::SharedPtr &node, std::shared_ptr<void> instance);
  void add_callback_group(rclcpp::CallbackGroup::SharedPtr group,
                          rclcpp::node_interfaces::NodeBaseInterface::SharedPtr node, bool notify = true) override;
  void remove_callback_group(rclcpp::CallbackGroup::SharedPtr group, bool notify = true) override;

  /// Which preemption mode this is, and why.
  [[nodiscard]] const redag::runtime::Mode &mode() const;
  [[nodiscard]] std::uint32_t workers() const;
  /// What a user should know: too few processors, tasks of the workload that no callback matches, middleware threads
  /// that could not be raised.
  [[nodiscard]] std::vector<std::string> warnings() const;

  /// Live figures of all callbacks, most urgent first. Cheap enough for once a second.
  [[nodiscard]] std::vector<CallbackStats> stats() const;

  /// Proven bounds on response times, by CallbackStats::task, for `redag top` to show.
  void set_live_bounds(std::map<std::string, redag::Duration> bounds);

  /// The callbacks as a workload, with what was learned: periods, edges, execution times (wcet: the longest seen).
  /// Ready for `redag analyze` once every callback has run.
  [[nodiscard]] redag::Workload learned() const;
  /// True once the learning window is over (or there is none).
  [[nodiscard]] bool learning_done() const;

  /// Appends the events since the last call; one thread at a time.
  void drain_trace(std::vector<redag::JobEvent> &events);
  /// Events that were not recorded since the start, because nobody drained them in time.
  [[nodiscard]] std::uint64_t lost_events() const;
  /// A trace as files and checks want it: all callbacks that there ever were as tasks of its workload, and the events
  /// with the ids that it gives them.
  [[nodiscard]] redag::trace::Trace as_trace(std::vector<redag::JobEvent> events) const;
  /// What such a trace says of the run until now, without events: task i of drained events is at positions[i] of the
  /// workload.
  [[nodiscard]] redag::trace::RunInfo run_info(std::vector<std::uint32_t> &positions) const;
  /// Of a drained event: "control.ekf", or to_string() of the callback's id.
  [[nodiscard]] std::string task_name(redag::TaskId task) const;

 protected:
  void spin_once_impl(std::chrono::nanoseconds timeout) override;
#if RCLCPP_VERSION_MAJOR >= 21
  rclcpp::FutureReturnCode spin_until_future_complete_impl(
      std::chrono::nanoseconds timeout,
      const std::function<std::future_status(std::chrono::nanoseconds)> &wait_for_future) override;
#endif

 private:
  RCLCPP_DISABLE_COPY(ReDAGExecutor)
#if RCLCPP_VERSION_MAJOR < 21
  void forget_expired();
#endif
  void spin_for_future(std::chrono::nanoseconds timeout);

  class Core;
  std::shared_ptr<Core> core_;
  std::atomic_bool occupied_{false};  // from the begin of a spin function until it returns, also after cancel()
};

}  // namespace redag_rclcpp
