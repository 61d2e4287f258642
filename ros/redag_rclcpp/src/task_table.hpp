// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// TaskTable knows the task of each callback: its DAG, name and parameters. It answers questions about tasks: figures,
// traces, the learned workload. Any thread may call it; its lock is the innermost.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "entities/callback.hpp"
#include "redag/base/histogram.hpp"
#include "redag/base/lock_guard.hpp"
#include "redag/base/pi_mutex.hpp"
#include "redag/engine/engine.hpp"
#include "redag/loader/callback_match.hpp"
#include "redag/model/workload.hpp"
#include "redag/trace/trace.hpp"
#include "redag_rclcpp/executor.hpp"
#include "watch/deadlock_detector.hpp"

namespace redag_rclcpp {

class TaskTable {
 public:
  /// A task that the scheduler has, or had.
  struct Entry {
    std::shared_ptr<Callback> callback;  // null once dropped
    redag::CallbackId id;
    redag::Task task;
    std::shared_ptr<const redag::Histogram> execution;  // of its jobs, processor time; null once dropped
    std::uint32_t dag = 0;                              // position in dags()
    std::uint32_t rank = 0;                             // topological rank within its DAG
    bool configured = false;                            // named by the workload
    std::uint32_t position = 0;                         // if so: among the tasks of its DAG there
    bool in_default_group = false;                      // of its node
    bool learned = false;                               // its period is not the one it began with
  };

  /// `platform`, `policy` and `ties` are the executor's. `configured` is the user's workload, or null. `is_traced`:
  /// keeps edges that have ended.
  TaskTable(redag::Platform platform, redag::PolicyKind policy, redag::Ties ties, const redag::Workload *configured,
            bool is_traced);

  /// The workload's DAGs without their tasks. The last one, "ros", is for callbacks that the workload does not name.
  [[nodiscard]] const std::vector<redag::Dag> &dags() const { return dags_; }

  /// Notes which tasks a task waits for, from now on. `at` was read after the engine knew of new ones, `before` ahead
  /// of that.
  void set_predecessors(redag::TaskId task, const std::vector<redag::TaskId> &predecessors, redag::Time before,
                        redag::Time at);
  /// The edges that the executor has executed, and when.
  [[nodiscard]] std::vector<redag::trace::Edge> edges() const;

  /// Sets the task of an id. An id may be reused after drop().
  void set(redag::TaskId task, Entry entry);
  void drop(redag::TaskId task);

  /// Returns "control.ekf", or to_string(CallbackId).
  [[nodiscard]] std::string name_of(redag::TaskId task) const;

  [[nodiscard]] CallbackPlace place_of(redag::TaskId task) const;
  /// The clients, and the servers with inputs that were not taken.
  [[nodiscard]] std::vector<Endpoint> endpoints() const;

  /// See ReDAGExecutor::stats().
  [[nodiscard]] std::vector<CallbackStats> stats(const redag::runtime::Engine &engine, bool percentiles) const;

  /// Gives callbacks without a stated rate the rate that was learned. Returns the changed tasks and their new period,
  /// which is also their deadline.
  std::vector<std::pair<redag::TaskId, redag::Duration>> adopt_rates();
  /// How many callbacks have a learned rate.
  [[nodiscard]] std::size_t count_learned() const;

  /// The present tasks with learned edges (see ReDAGExecutor::learned).
  [[nodiscard]] redag::Workload learned() const;

  /// All tasks that ever existed. Task i of the engine is at positions[i] of the workload.
  [[nodiscard]] redag::Workload describe(std::vector<std::uint32_t> &positions) const;

 private:
  /// Task ids in the engine, by DAG and position in the workload.
  using Ids = std::vector<std::vector<std::uint32_t>>;

  [[nodiscard]] std::string name(const Entry &entry) const;
  [[nodiscard]] CallbackPlace place(const Entry &entry) const;
  [[nodiscard]] redag::Duration seen_period(const Entry &entry, int depth) const REDAG_REQUIRES(lock_);
  [[nodiscard]] redag::Workload as_workload(Ids &ids, bool live) const REDAG_REQUIRES(lock_);
  void add_seen_edges(redag::Workload &workload, const Ids &ids) const REDAG_REQUIRES(lock_);
  void add_configured_edges(redag::Dag &dag, std::size_t task, const Entry &entry) const;

  const redag::Platform platform_;
  const redag::PolicyKind policy_;
  const redag::Ties ties_;
  const redag::Workload *const configured_;
  const bool is_traced_;
  std::vector<redag::Dag> dags_;

  mutable redag::PiMutex lock_;
  std::vector<Entry> entries_ REDAG_GUARDED_BY(lock_);  // indexed by TaskId
  std::vector<redag::trace::Edge> edges_ REDAG_GUARDED_BY(lock_);
};

}  // namespace redag_rclcpp
