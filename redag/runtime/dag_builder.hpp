// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Builds one DAG of C++ functions for Executor::add(). Owns the tasks and their bodies until then. Not thread-safe.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "redag/engine/coroutine.hpp"
#include "redag/model/workload.hpp"

namespace redag::runtime {

using std::chrono::nanoseconds;

class EventSource;

/// Names a task of a DagBuilder as a predecessor of later tasks of the same DagBuilder.
class TaskHandle {
  friend class DagBuilder;
  TaskHandle(std::uint32_t index, std::uint64_t serial) : index_(index), serial_(serial) {}
  std::uint32_t index_;
  std::uint64_t serial_;  // unique among all builders' tasks; index_ alone could match a task of another one
};

/// Names a task whose jobs the program releases: the argument of Executor::release(). A handle can be copied, and be
/// used as a predecessor.
class EventHandle : public TaskHandle {
  friend class DagBuilder;
  friend class Executor;
  EventHandle(const TaskHandle &task, std::shared_ptr<EventSource> source)
      : TaskHandle(task), source_(std::move(source)) {}
  std::shared_ptr<EventSource> source_;
};

/// What happens to a release that comes before the minimum inter-arrival time has passed since the last one.
enum class EarlyRelease : std::uint8_t {
  Skip,    // its job is skipped (`overrun`), which is a deadline miss; the others keep the time that they were promised
  Accept,  // it is a release like any other
};

/// The keys of a DAG in a workload file (docs/workload_format.md), except `cluster`: an Executor is one cluster.
struct DagOptions {
  std::uint32_t max_active = 0;   // jobs started and not finished at any time; 0: no bound
  std::uint32_t max_pending = 0;  // jobs released and not started at any time; 0: no bound
  Criticality criticality = Criticality::Normal;
  nanoseconds deadline{0};  // end to end, from a source's release to a sink's finish; 0: none
  Degrade degrade{};        // in HI mode; only if the DAG is not of high criticality
};

/// The keys of a task in a workload file, except `callback`, which names a callback of ROS 2.
struct TaskOptions {
  nanoseconds wcet{0};      // assumed processor time; jobs that exceed it are counted; 0: unknown
  nanoseconds bcet{0};      // shortest execution, for analysis and simulation
  nanoseconds wcet_low{0};  // C(LO) of a task of a high-criticality DAG: a job that uses it begins HI mode; 0: none
  nanoseconds deadline{0};  // relative; 0: the period
  nanoseconds offset{0};    // of the first release (timers)
  nanoseconds jitter{0};    // releases of a timer are delayed at random by up to this much
  nanoseconds region{0};    // longest stretch without a preemption_point(), for analysis; 0: the whole job
  nanoseconds budget{0};    // processor time after which `on_budget` happens; 0: none
  OnBudget on_budget = OnBudget::Abort;  // at the next preemption_point(), or when a watchdog looks
  Overrun overrun = Overrun::Skip;
  std::uint32_t queue_depth = 1;            // for Overrun::Queue
  std::optional<int> priority{};            // for PolicyKind::Fixed
  std::uint32_t concurrency = 1;            // most jobs in progress at once: calls of the body overlap
  std::string group{};                      // jobs of one group never overlap, in any DAG
  std::vector<TaskHandle> after{};          // predecessors of a timer
  ExecutionTime execution{};                // for simulation
  EarlyRelease early = EarlyRelease::Skip;  // for event()
};

/// The body of a task: a function, or one that returns redag::Coroutine, whose jobs can wait without a worker. It is
/// kept until the last job of its task has ended: a coroutine may use what its lambda has captured.
class TaskBody {
 public:
  TaskBody() = default;
  TaskBody(std::nullptr_t /*none*/) {}  // NOLINT(google-explicit-constructor)
  template <class F>
  requires(!std::is_same_v<std::remove_cvref_t<F>, TaskBody> && std::is_invocable_v<F &>)
      // Functions are passed as bodies.
      // NOLINTNEXTLINE(google-explicit-constructor,bugprone-forwarding-reference-overload)
      TaskBody(F &&body) {
    if constexpr (std::is_same_v<std::invoke_result_t<F &>, Coroutine>) {
      coroutine_ = std::forward<F>(body);
    } else {
      function_ = std::forward<F>(body);
    }
  }

  /// Returns true if there is a function.
  [[nodiscard]] explicit operator bool() const { return function_ || coroutine_; }

 private:
  friend class Executor;
  std::function<void()> function_;
  std::function<Coroutine()> coroutine_;
};

/// timer(), data() and event() throw std::invalid_argument for a task without a body, for a predecessor that is no task
/// of this DagBuilder, and for an option that does not apply. Executor::add() knows the policy. It finds all other
/// mistakes and reports all of them.
class DagBuilder {
 public:
  explicit DagBuilder(std::string name, const DagOptions &options = {});

  /// Adds a task that is released every `period`.
  TaskHandle timer(std::string name, nanoseconds period, TaskBody body, const TaskOptions &options = {});

  /// Adds a task that is released when every predecessor has completed once more.
  TaskHandle data(std::string name, const std::vector<TaskHandle> &predecessors, TaskBody body,
                  const TaskOptions &options = {});

  /// Adds a task whose jobs the program releases with Executor::release(), from any thread: a sporadic task. In the
  /// model it is a timer task whose period is `min_interval`, the minimum inter-arrival time.
  EventHandle event(std::string name, nanoseconds min_interval, TaskBody body, const TaskOptions &options = {});

  /// The DAG as a value, with the periods and deadlines that tasks inherit: for analysis and for workload files.
  [[nodiscard]] Dag dag() const;

 private:
  friend class Executor;
  TaskHandle append(Task task, const char *call, const std::vector<TaskHandle> &predecessors, TaskBody body,
                    const TaskOptions &options);

  Dag dag_;
  std::vector<TaskBody> bodies_;
  std::vector<std::uint64_t> serials_;                 // of the tasks
  std::vector<std::shared_ptr<EventSource>> sources_;  // of the tasks; null: not event()
};

}  // namespace redag::runtime
