// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Which callback is which task: of which DAG, under which name, with which parameters. For all who ask about tasks:
// figures, traces, what was learned. Decides nothing. Any thread; its lock is the innermost.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "callback.hpp"
#include "redag/base/lock_guard.hpp"
#include "redag/base/pi_mutex.hpp"
#include "redag/live/frame_builder.hpp"
#include "redag/model/callback_match.hpp"
#include "redag/model/workload.hpp"
#include "redag/runtime/engine.hpp"
#include "redag/trace/trace.hpp"
#include "redag_rclcpp/executor.hpp"

namespace redag_rclcpp {

class TaskTable {
 public:
  /// A task that the scheduler has, or had.
  struct Entry {
    std::shared_ptr<Callback> callback;  // null once dropped
    redag::CallbackId id;
    redag::Task task;
    std::uint32_t dag = 0;    // position in dags()
    std::uint32_t rank = 0;   // topological, in its DAG
    bool configured = false;  // named by the workload
  };

  /// `platform`, `policy` and `ties`: the executor's. `configured`: what the user's workload says, or null.
  TaskTable(redag::Platform platform, redag::PolicyKind policy, redag::Ties ties, const redag::Workload *configured);

  /// The workload's, and last that of all that it does not name. Without tasks.
  [[nodiscard]] const std::vector<redag::Dag> &dags() const { return dags_; }

  /// An id can be given again once it was dropped.
  void set(redag::TaskId task, Entry entry);
  void drop(redag::TaskId task);

  /// "control.ekf", or to_string(CallbackId).
  [[nodiscard]] std::string name_of(redag::TaskId task) const;

  /// Most urgent first.
  [[nodiscard]] std::vector<CallbackStats> stats(const redag::runtime::Engine &engine) const;

  /// For the live page. `bounds`: on response times, by the name of the task.
  void sample(const redag::runtime::Engine &engine, const std::map<std::string, redag::Duration> &bounds,
              redag::live::Sample &sample) const;

  /// Gives callbacks without a rate of their own the one they were seen to have: the tasks that change, with their
  /// new period and deadline.
  std::vector<std::pair<redag::TaskId, redag::Duration>> adopt_rates();

  /// What there is now, with the edges that were seen (see ReDAGExecutor::learned).
  [[nodiscard]] redag::Workload learned() const;

  /// All that there ever was; task i of the engine is at positions[i] of the workload.
  [[nodiscard]] redag::Workload describe(std::vector<std::uint32_t> &positions) const;

 private:
  /// The ids of a workload's tasks, DAG by DAG.
  using Ids = std::vector<std::vector<std::uint32_t>>;

  [[nodiscard]] std::string name(const Entry &entry) const;
  [[nodiscard]] redag::Duration seen_period(const Entry &entry, int depth) const REDAG_REQUIRES(lock_);
  [[nodiscard]] redag::Workload as_workload(Ids &ids, bool live) const REDAG_REQUIRES(lock_);
  void add_seen_edges(redag::Workload &workload, const Ids &ids) const REDAG_REQUIRES(lock_);
  void add_configured_edges(redag::Dag &dag, std::size_t task, const Entry &entry) const;

  const redag::Platform platform_;
  const redag::PolicyKind policy_;
  const redag::Ties ties_;
  const redag::Workload *const configured_;
  std::vector<redag::Dag> dags_;

  mutable redag::PiMutex lock_;
  std::vector<Entry> entries_ REDAG_GUARDED_BY(lock_);  // by TaskId
};

}  // namespace redag_rclcpp
