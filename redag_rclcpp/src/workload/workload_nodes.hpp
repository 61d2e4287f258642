// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// A workload as real ROS 2 nodes: a node per task (or per exclusive group), a wall timer per timer task, a topic per
// task with successors, a subscription per edge. Bodies use the processor time that the workload asks for, publish at
// their end, and record when they began and ended; node_events() makes jobs of that. Knows no executor.
//
// Threads: bodies run on the executor's threads, which may be many; everything else on one thread.
#pragma once

#include <algorithm>
#include <atomic>
#include <cstdint>
#include <deque>
#include <memory>
#include <string>
#include <vector>

#include "rclcpp/rclcpp.hpp"
#include "redag/base/result.hpp"
#include "redag/model/job_event.hpp"
#include "redag/model/workload.hpp"
#include "redag/trace/ring.hpp"
#include "std_msgs/msg/int64_multi_array.hpp"

namespace redag_rclcpp {

/// rclcpp's steady clock, on which timers expire; in some distributions it is not std::chrono's.
[[nodiscard]] redag::Time timer_clock_now() noexcept;

struct NodesOptions {
  std::uint64_t seed = 1;
  bool intra_process = true;        // messages as pointers, or through the middleware
  bool redag = false;               // the executor is ours: bodies can be suspended at preemption points
  std::uint32_t threads = 1;        // at most so many threads execute bodies
  redag::Time end = redag::kNever;  // no body begins at or after it, though nobody may get to say halt() in time
  std::size_t trace_capacity = std::size_t{1} << 15U;  // events a thread between two drain()
};

/// What ROS 2 cannot do of a workload. Errors: that would change what is measured. Warnings: that is ignored.
[[nodiscard]] redag::Diagnostics ros_limits(const redag::Workload &workload);

class WorkloadNodes {
 public:
  /// Requires a valid workload without errors in ros_limits(). rclcpp must be initialised. May throw what rclcpp
  /// throws.
  WorkloadNodes(const redag::Workload &workload, const NodesOptions &options);
  ~WorkloadNodes();
  WorkloadNodes(const WorkloadNodes &) = delete;
  WorkloadNodes &operator=(const WorkloadNodes &) = delete;

  /// Waits until every subscription knows its publisher. Error: not in time, or somebody else uses the same topics.
  [[nodiscard]] redag::Result<void> connect(redag::Duration timeout);

  /// Creates the timers so that they expire at origin + offset + k * period, k = 0, 1, ... Call once, before the nodes
  /// are given to an executor, and in good time before `origin` (timer_clock_now()).
  void arm(redag::Time origin);

  [[nodiscard]] const std::vector<rclcpp::Node::SharedPtr> &nodes() const { return nodes_; }

  /// The workload as ReDAGOptions::workload wants it: every callback of the nodes is bound to a task.
  [[nodiscard]] redag::Workload bound_workload() const;

  /// The current time on the origin's clock.
  [[nodiscard]] redag::Time now() const noexcept { return timer_clock_now() - origin_; }

  /// Bodies record when they were without a processor (preemption os). Before the nodes are given to an executor.
  void note_absences() noexcept { notes_absences_ = true; }

  /// No body begins from now on.
  void halt() noexcept { halting_.store(true); }
  /// After halt(): waits until none runs; false: not by `deadline` (timer_clock_now()).
  [[nodiscard]] bool wait_idle(redag::Time deadline) const;
  /// Bodies that run end at once.
  void give_up() noexcept { give_up_.store(true); }

  /// Appends what bodies recorded since the last call; see node_events().
  void drain(std::vector<redag::JobEvent> &events);
  [[nodiscard]] std::uint64_t lost_events() const;
  /// Threads that executed bodies so far; JobEvent::worker counts them.
  [[nodiscard]] std::uint32_t threads_seen() const { return std::min(next_thread_.load(), options_.threads); }
  /// How far the timers' grid is off origin + offset, at most.
  [[nodiscard]] redag::Duration phase_error() const { return phase_error_; }

  /// What measuring adds to a job: two looks at the clock, two records, and of a timer which expiry it is.
  [[nodiscard]] redag::Duration measurement_cost();

 private:
  using Message = std_msgs::msg::Int64MultiArray;
  struct Input;
  struct Output;
  struct TaskNode;
  struct Job;

  void create_node(TaskNode &task);
  void create_topics();
  void create_timer(TaskNode &task);
  void on_timer(TaskNode &task, std::int64_t job);
  void on_message(TaskNode &task, Input &input, const Message &message);
  void run_if_complete(TaskNode &task);
  void execute(TaskNode &task, const Job &job);
  void publish(TaskNode &task, const Job &job, redag::Time finish);
  void use_processor(redag::Duration demand, redag::Duration region, redag::JobEvent job, redag::trace::Ring *events);
  [[nodiscard]] std::int64_t expired_job(TaskNode &task) const;
  redag::trace::Ring *ring(std::uint32_t &thread) noexcept;
  void record(const redag::JobEvent &event, redag::trace::Ring *ring) noexcept;

  const redag::Workload &workload_;
  NodesOptions options_;
  std::uint64_t instance_;  // of this object: threads may have worked for another one
  redag::Time origin_ = 0;
  redag::Duration phase_error_ = 0;
  bool notes_absences_ = false;
  std::deque<TaskNode> tasks_;  // by TaskId
  std::vector<rclcpp::Node::SharedPtr> nodes_;
  std::vector<std::unique_ptr<redag::trace::Ring>> rings_;
  std::atomic<std::uint32_t> next_thread_{0};
  std::atomic<std::uint64_t> lost_{0};  // of threads beyond options_.threads
  std::atomic<std::uint32_t> running_{0};
  std::atomic<bool> halting_{false};
  std::atomic<bool> give_up_{false};
};

}  // namespace redag_rclcpp
