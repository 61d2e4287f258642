// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// ReDAGExecutor executes the callbacks of all its nodes in one global order, most urgent first. The library's scheduler
// decides the order. The class takes the place of rclcpp::executors::MultiThreadedExecutor; docs/ros2.md lists the
// differences.
//
// Threads: as with rclcpp's executors, every function may be called while the executor spins, and from callbacks. The
// spin functions are the exception. They throw until the previous spin function has returned, even if that one was
// cancelled.
#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <exception>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "rclcpp/executor.hpp"
#include "redag/engine/engine.hpp"
#include "redag/loader/callback_match.hpp"
#include "redag/model/valid_workload.hpp"
#include "redag/threads/setup.hpp"
#include "redag/trace/trace.hpp"
#include "redag_rclcpp/distribution.hpp"

namespace redag_rclcpp {

/// An exception that left a callback.
struct ExceptionInfo {
  std::string task;  // "control.ekf", or the callback's own description
  std::exception_ptr exception;
};

enum class OnException : std::uint8_t {
  Stop,      // spinning ends as by cancel(), and the spin function throws the first such exception
  Continue,  // the job counts as aborted; spinning continues
};

struct ReDAGOptions {
  std::uint32_t workers = 0;  // callbacks that execute at the same time; 0: one per usable processor
  redag::PreemptionMode preemption = redag::PreemptionMode::Auto;
  /// Callbacks that can be started and unfinished at once. With none and cooperative, those beyond `workers` are in a
  /// redag::Blocking, without a worker. 0: with os workers + 16, otherwise as many as workers.
  std::uint32_t threads = 0;
  std::vector<int> cpus{};  // processors for the workers; empty: os takes `workers` of the usable ones

  /// States which callback is which task of which DAG (docs/workload_format.md, `callback`). Its policy and ties decide
  /// the order. Of its platform, the executor takes the devices alone, for redag_rclcpp::device() (coroutine.hpp).
  /// declare_options() takes the rest. Made by redag::validated(), which is in redag::redag.
  std::optional<redag::ValidWorkload> workload{};
  /// Period of a callback whose period neither the workload nor a timer states. It decides the callback's priority
  /// until a rate is learned. Must be above 0.
  std::chrono::nanoseconds default_period = std::chrono::milliseconds(100);
  /// Time in which the rate of a callback is learned, and who publishes to it, from its first message after the first
  /// spin on. The third message already tells a rate; after this time it is frozen. 0: no learning.
  std::chrono::nanoseconds learn = std::chrono::nanoseconds(0);

  /// os: while spin() runs, raises the middleware's threads that deliver messages above the workers, where they are
  /// known (Cyclone DDS, Fast DDS). Otherwise busy workers could delay the messages that they wait for.
  bool raise_middleware = true;
  /// Locks memory as the process uses it, and touches the stacks of the threads beforehand, to spare callbacks page
  /// faults. warnings() tells if the system refuses.
  bool lock_memory = false;
  /// Logs a warning about each callback that is in progress for longer than this, while it runs; 0: no watchdog. With a
  /// watchdog, `on_budget` and HI mode also take effect in callbacks without preemption points.
  std::chrono::nanoseconds watchdog{};
  std::size_t trace_capacity = 0;  // events that the rings hold between two drain_trace(); 0: no events
  /// Called on the thread that executed the callback; must not throw. Empty: Stop.
  std::function<OnException(const ExceptionInfo &)> on_exception{};
};

/// Figures of one callback since it was added.
struct CallbackStats {
  redag::CallbackId id;
  redag::TaskId key;           // of its events in the trace, and of engine()'s figures, while it exists
  std::string dag;             // "" if the workload does not name it
  std::string task;            // "control.ekf", or to_string(id)
  redag::Duration period = 0;  // decides its priority; stated by a timer or the workload, learned, or the default
  redag::Duration deadline = 0;
  redag::Duration wcet = 0;          // stated by the workload; 0: not stated
  redag::sched::Accounting jobs;     // `skipped`: releases that were missed or overwritten before they could start
  std::uint64_t misses = 0;          // jobs that ended late, were skipped, or lost their timer expiry
  redag::Duration response_p50 = 0;  // from the release (timer: expected call; message: arrival) to the end
  redag::Duration response_p99 = 0;
  redag::Duration response_max = 0;
  redag::Duration execution_p50 = 0;  // processor time
  redag::Duration execution_p99 = 0;
  redag::Duration execution_max = 0;
  std::uint32_t waits = 0;                // the most co_awaits of one job
  std::vector<redag::TaskId> publishers;  // keys of the callbacks that published the messages which arrived here
};

/// A callback that waited for a response which could not reach it.
struct Deadlock {
  std::string waiting;    // the callback that waited: "control.ekf", or to_string() of its id
  std::string blocked;    // the callback that could not start: the client's, the service's, the action's
  std::string resource;   // what it could not get: "the default callback group of /planner", "any of the 2 workers"
  std::string text;       // all of this in sentences, with the remedies
  bool certain = true;    // false: the callback may also wait for something else
  redag::Time begun = 0;  // when it was noticed, on the clock of the trace
  redag::Time ended = redag::kNever;  // kNever: it lasts
};

class ReDAGExecutor : public rclcpp::Executor {
 public:
  RCLCPP_SMART_PTR_DEFINITIONS(ReDAGExecutor)

  /// Throws std::runtime_error if preemption `os` is requested and not available. The text says how to get it.
  explicit ReDAGExecutor(const rclcpp::ExecutorOptions &options = rclcpp::ExecutorOptions(),
                         ReDAGOptions redag_options = ReDAGOptions());
  explicit ReDAGExecutor(ReDAGOptions redag_options);
  ~ReDAGExecutor() override;

  /// Executes callbacks on the workers until cancel() or shutdown. Returns when the callbacks that had started have
  /// ended. Throws the first exception of a callback (see ReDAGOptions::on_exception).
  void spin() override;
  // These three execute on the calling thread, one callback at a time, most urgent first.
  void spin_some(std::chrono::nanoseconds max_duration = std::chrono::nanoseconds(0)) override;
  void spin_all(std::chrono::nanoseconds max_duration) override;
  void spin_once(std::chrono::nanoseconds timeout = std::chrono::nanoseconds(-1)) override;

  /// As rclcpp's. A call before the very first spin makes that spin return at once; rclcpp forgets such a call.
  void cancel() REDAG_RCLCPP_OVERRIDES_CANCEL;

  using rclcpp::Executor::add_node;
  using rclcpp::Executor::remove_node;
  void add_node(distribution::NodePointer node, bool notify = true) override;
  void remove_node(distribution::NodePointer node, bool notify = true) override;
  /// Removes the node, and holds `instance` until the node's callbacks in progress have ended. `instance` is the object
  /// whose members these callbacks use. Then releases it, which destroys it unless it has other owners. remove_node(),
  /// in contrast, waits for no callback.
  void retire_node(const rclcpp::node_interfaces::NodeBaseInterface::SharedPtr &node, std::shared_ptr<void> instance);
  void add_callback_group(distribution::GroupPointer group, distribution::NodePointer node,
                          bool notify = true) override;
  void remove_callback_group(distribution::GroupPointer group, bool notify = true) override;

  /// The preemption mode that was taken, and the reason.
  [[nodiscard]] const redag::runtime::Mode &mode() const;
  [[nodiscard]] std::uint32_t workers() const;
  /// Warnings for the user: for instance too few processors, tasks of the workload that no callback matches, or
  /// middleware threads that could not be raised.
  [[nodiscard]] std::vector<std::string> warnings() const;
  /// Those of warnings() that break a promise about deadlines now. With os: more workers than processors, priorities
  /// that the system refuses, or an order that is lost.
  [[nodiscard]] std::vector<std::string> errors() const;

  /// Callbacks that waited, while spin() ran, for a response which cannot reach them: the callback itself, or others
  /// that wait like it, keep the response's callback from starting (docs/ros2.md, "A call that waits for itself"). In
  /// the order of their beginning; the last 100. The log names each.
  [[nodiscard]] std::vector<Deadlock> deadlocks() const;

  /// Live figures of all callbacks, shortest period first. Cheap enough to call once a second. Without percentiles,
  /// which stay 0, it is several times as cheap.
  [[nodiscard]] std::vector<CallbackStats> stats(bool percentiles = true) const;

  /// The workload's DAGs without their tasks. The last one, "ros", is for callbacks that the workload does not name.
  [[nodiscard]] const std::vector<redag::Dag> &dags() const;
  /// For observers: figures of threads and devices, and jobs in progress.
  [[nodiscard]] const redag::runtime::Engine &engine() const;

  /// The callbacks as a workload, with the learned periods, edges and execution times (`wcet`: the longest seen).
  /// `redag analyze` accepts it once every callback has run.
  [[nodiscard]] redag::Workload learned() const;
  /// True once the learning window is over, or if there is none.
  [[nodiscard]] bool learning_done() const;

  /// Appends the events since the last call. Only one thread may call this at a time.
  void drain_trace(std::vector<redag::JobEvent> &events);
  /// Events since the start that were not recorded because a ring was full: drain_trace() came too late.
  [[nodiscard]] std::uint64_t lost_events() const;
  /// A trace for files and checks. Its workload holds as tasks all callbacks that ever existed, and the events carry
  /// the ids of these tasks.
  [[nodiscard]] redag::trace::Trace as_trace(std::vector<redag::JobEvent> events) const;
  /// The trace's description of the run until now, without events. Task i of the drained events is at positions[i] of
  /// its workload.
  [[nodiscard]] redag::trace::RunInfo run_info(std::vector<std::uint32_t> &positions) const;
  /// Name of a drained event's task: "control.ekf", or to_string() of the callback's id.
  [[nodiscard]] std::string task_name(redag::TaskId task) const;

 protected:
  void spin_once_impl(std::chrono::nanoseconds timeout) override;
  rclcpp::FutureReturnCode spin_until_future_complete_impl(
      std::chrono::nanoseconds timeout,
      const std::function<std::future_status(std::chrono::nanoseconds)> &wait_for_future)
      REDAG_RCLCPP_OVERRIDES_SPIN_UNTIL_FUTURE_COMPLETE;

 private:
  RCLCPP_DISABLE_COPY(ReDAGExecutor)
  void spin_for_future(std::chrono::nanoseconds timeout);

  class Core;
  std::shared_ptr<Core> core_;
  std::atomic_bool occupied_{false};  // set from the start of a spin function until its return, also after cancel()
};

}  // namespace redag_rclcpp
