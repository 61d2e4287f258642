// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// WorkloadNodes runs a workload as real ROS 2 nodes. It has a node per task (or per exclusive group), a wall timer per
// timer task, a topic per task with successors, and a subscription per edge. Bodies use the processor time that the
// workload states, publish at their end, and record when they began and ended. node_events() derives jobs from these
// records. The class knows no executor.
//
// Threads: bodies run on any number of executor threads. Everything else runs on one thread.
#pragma once

#include <algorithm>
#include <atomic>
#include <cstdint>
#include <deque>
#include <memory>
#include <string>
#include <vector>

#include "phased_timer.hpp"
#include "rclcpp/rclcpp.hpp"
#include "redag/base/result.hpp"
#include "redag/model/job_event.hpp"
#include "redag/model/workload.hpp"
#include "redag/trace/ring.hpp"
#include "std_msgs/msg/int64_multi_array.hpp"

namespace redag_rclcpp::lab {

struct NodesOptions {
  std::uint64_t seed = 1;
  bool intra_process = true;        // false: messages pass through the middleware
  bool redag = false;               // the executor is ReDAGExecutor: preemption points can suspend bodies
  std::uint32_t threads = 1;        // largest number of threads that execute bodies
  redag::Time end = redag::kNever;  // no body begins at or after it, even if halt() comes late
  std::size_t trace_capacity = std::size_t{1} << 15U;  // events per thread between two drain()
};

/// Finds what ROS 2 cannot do of a workload. Errors would change the measurement. Warnings are features that are
/// ignored.
[[nodiscard]] redag::Diagnostics ros_limits(const redag::Workload &workload);

class WorkloadNodes {
 public:
  /// Requires a valid workload without errors in ros_limits(), and an initialised rclcpp. May throw rclcpp's
  /// exceptions.
  WorkloadNodes(const redag::Workload &workload, const NodesOptions &options);
  ~WorkloadNodes();
  WorkloadNodes(const WorkloadNodes &) = delete;
  WorkloadNodes &operator=(const WorkloadNodes &) = delete;

  /// Waits until every subscription knows its publisher. Error: the time is over, or another program uses the same
  /// topics.
  [[nodiscard]] redag::Result<void> connect(redag::Duration timeout);

  /// Creates the timers, which expire at origin + offset + k * period, k = 0, 1, ... Call it once, before the nodes are
  /// added to an executor, and well before `origin` (on timer_clock_now()).
  void arm(redag::Time origin);

  [[nodiscard]] const std::vector<rclcpp::Node::SharedPtr> &nodes() const { return nodes_; }

  /// The workload for ReDAGOptions::workload: every callback of the nodes is bound to a task.
  [[nodiscard]] redag::Workload bound_workload() const;

  /// Time since the origin.
  [[nodiscard]] redag::Time now() const noexcept { return timer_clock_now() - origin_; }

  /// Makes bodies record when they had no processor (preemption os). Call it before the nodes are added to an executor.
  void note_absences() noexcept { notes_absences_ = true; }

  /// Lets no further body begin.
  void halt() noexcept { halting_.store(true); }
  /// Waits, after halt(), until no body runs. False: one still runs at `deadline` (on timer_clock_now()).
  [[nodiscard]] bool wait_idle(redag::Time deadline) const;
  /// Makes running bodies end at once.
  void give_up() noexcept { give_up_.store(true); }

  /// Appends the events that bodies recorded since the last call; see node_events().
  void drain(std::vector<redag::JobEvent> &events);
  [[nodiscard]] std::uint64_t lost_events() const;
  /// Number of threads that have executed bodies. JobEvent::worker is below it.
  [[nodiscard]] std::uint32_t threads_seen() const { return std::min(next_thread_.load(), options_.threads); }
  /// Largest distance of the timers' grid from origin + offset.
  [[nodiscard]] redag::Duration phase_error() const { return phase_error_; }

  /// Time that measuring adds to a job: two clock readings, two records, and for a timer the number of its expiry.
  [[nodiscard]] redag::Duration measurement_cost();

 private:
  using Message = std_msgs::msg::Int64MultiArray;
  struct Input;
  struct Output;
  struct TaskNode;
  struct Job;

  void create_node(TaskNode &task);
  void create_topics();
  void on_timer(TaskNode &task, std::int64_t job);
  void on_message(TaskNode &task, Input &input, const Message &message);
  void run_if_complete(TaskNode &task);
  void execute(TaskNode &task, const Job &job);
  void publish(TaskNode &task, const Job &job, redag::Time finish);
  void use_processor(redag::Duration demand, redag::Duration region, redag::JobEvent job, redag::trace::Ring *events);
  redag::trace::Ring *ring(std::uint32_t &thread) noexcept;
  void record(const redag::JobEvent &event, redag::trace::Ring *ring) noexcept;

  const redag::Workload &workload_;
  NodesOptions options_;
  std::uint64_t instance_;  // tells this object from earlier ones that the same threads worked for
  redag::Time origin_ = 0;
  redag::Duration phase_error_ = 0;
  bool notes_absences_ = false;
  std::deque<TaskNode> tasks_;  // indexed by TaskId
  std::vector<rclcpp::Node::SharedPtr> nodes_;
  std::vector<std::unique_ptr<redag::trace::Ring>> rings_;
  std::atomic<std::uint32_t> next_thread_{0};
  std::atomic<std::uint64_t> lost_{0};  // events of threads beyond options_.threads
  std::atomic<std::uint32_t> running_{0};
  std::atomic<bool> halting_{false};
  std::atomic<bool> give_up_{false};
};

}  // namespace redag_rclcpp::lab
