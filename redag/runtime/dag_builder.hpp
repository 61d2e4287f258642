// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Builds one DAG of C++ functions for Executor::add(). Owns the tasks and their bodies until then. Not thread-safe.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "redag/model/workload.hpp"

namespace redag::runtime {

using std::chrono::nanoseconds;

/// Names a task of a DagBuilder as a predecessor of later tasks of the same DagBuilder.
class TaskHandle {
  friend class DagBuilder;
  TaskHandle(std::uint32_t index, std::uint64_t serial) : index_(index), serial_(serial) {}
  std::uint32_t index_;
  std::uint64_t serial_;  // unique among all builders' tasks; index_ alone could match a task of another one
};

struct DagOptions {
  std::uint32_t max_active = 0;   // jobs started and not finished at any time; 0: no bound
  std::uint32_t max_pending = 0;  // jobs released and not started at any time; 0: no bound
  Criticality criticality = Criticality::Normal;
};

struct TaskOptions {
  nanoseconds wcet{0};      // assumed processor time; jobs that exceed it are counted; 0: unknown
  nanoseconds deadline{0};  // relative; 0: the period
  nanoseconds offset{0};    // of the first release (timers)
  nanoseconds budget{0};    // processor time after which the next preemption_point() ends the job; 0: none
  Overrun overrun = Overrun::Skip;
  std::uint32_t queue_depth = 1;    // for Overrun::Queue
  std::optional<int> priority{};    // for PolicyKind::Fixed
  std::string group{};              // jobs of one group never overlap, in any DAG
  std::vector<TaskHandle> after{};  // predecessors of a timer
};

/// timer() and data() throw std::invalid_argument for a task without a body, and for a predecessor that is no task of
/// this DagBuilder. Executor::add() knows the policy. It finds all other mistakes and reports all of them.
class DagBuilder {
 public:
  using Function = std::function<void()>;

  explicit DagBuilder(std::string name, const DagOptions &options = {});

  /// Adds a task that is released every `period`.
  TaskHandle timer(std::string name, nanoseconds period, Function body, const TaskOptions &options = {});

  /// Adds a task that is released when every predecessor has completed once more.
  TaskHandle data(std::string name, const std::vector<TaskHandle> &predecessors, Function body,
                  const TaskOptions &options = {});

 private:
  friend class Executor;
  TaskHandle append(Task task, const std::vector<TaskHandle> &predecessors, Function body, const TaskOptions &options);

  Dag dag_;
  std::vector<Function> bodies_;
  std::vector<std::uint64_t> serials_;  // of the tasks
};

}  // namespace redag::runtime
