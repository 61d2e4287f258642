// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/runtime/dag_builder.hpp"

#include <atomic>
#include <stdexcept>
#include <utility>

#include "redag/runtime/dag_mistakes.hpp"
#include "redag/runtime/event_source.hpp"

namespace redag::runtime {

DagBuilder::DagBuilder(std::string name, const DagOptions &options) {
  dag_.name = std::move(name);
  dag_.max_active = options.max_active;
  dag_.max_pending = options.max_pending;
  dag_.criticality = options.criticality;
  dag_.deadline = options.deadline.count();
  dag_.degrade = options.degrade;
}

TaskHandle DagBuilder::timer(std::string name, nanoseconds period, TaskBody body, const TaskOptions &options) {
  Task task;
  task.name = std::move(name);
  task.period = period.count();
  return append(std::move(task), "timer", options.after, std::move(body), options);
}

TaskHandle DagBuilder::data(std::string name, const std::vector<TaskHandle> &predecessors, TaskBody body,
                            const TaskOptions &options) {
  Task task;
  task.name = std::move(name);
  task.activation = Activation::Data;
  if (!options.after.empty()) {
    throw std::invalid_argument(
        place_of(dag_.name, "data", task.name) +
        ": TaskOptions::after applies to timer() only (name all predecessors in the second argument of data())");
  }
  return append(std::move(task), "data", predecessors, std::move(body), options);
}

EventHandle DagBuilder::event(std::string name, nanoseconds min_interval, TaskBody body, const TaskOptions &options) {
  const std::string place = place_of(dag_.name, "event", name);
  if (!options.after.empty()) {
    throw std::invalid_argument(place + ": TaskOptions::after applies to timer() only (events have no predecessors)");
  }
  if (options.offset.count() != 0 || options.jitter.count() != 0) {
    throw std::invalid_argument(place + ": TaskOptions::offset and jitter apply to timer() only");
  }
  Task task;
  task.name = std::move(name);
  task.period = min_interval.count();
  task.phase = Phase::Event;
  const auto source = std::make_shared<EventSource>(place, task.period, options.early);
  const TaskHandle handle = append(std::move(task), "event", {}, std::move(body), options);
  sources_.back() = source;
  return EventHandle(handle, source);
}

Dag DagBuilder::dag() const {
  Dag dag = dag_;
  inherit_periods(dag);  // a handle exists before its successors: the edges have no cycle
  return dag;
}

TaskHandle DagBuilder::append(Task task, const char *call, const std::vector<TaskHandle> &predecessors, TaskBody body,
                              const TaskOptions &options) {
  const auto refuse = [&](const char *why) {
    throw std::invalid_argument(place_of(dag_.name, call, task.name) + ": " + why);
  };
  if (!body) refuse("the task has no body (pass a function that is not empty)");
  for (const TaskHandle handle : predecessors) {
    if (handle.index_ >= serials_.size() || serials_[handle.index_] != handle.serial_) {
      refuse("a predecessor belongs to another DagBuilder (use handles that this DagBuilder returned)");
    }
    task.predecessors.push_back(handle.index_);
  }
  task.wcet = options.wcet.count();
  task.bcet = options.bcet.count();
  task.wcet_low = options.wcet_low.count();
  task.deadline = options.deadline.count();
  task.offset = options.offset.count();
  task.jitter = options.jitter.count();
  task.region = options.region.count();
  task.budget = options.budget.count();
  task.on_budget = options.on_budget;
  task.overrun = options.overrun;
  task.queue_depth = options.queue_depth;
  task.priority = options.priority;
  task.concurrency = options.concurrency;
  task.execution = options.execution;
  task.group = options.group;
  task.criticality = dag_.criticality;
  static std::atomic<std::uint64_t> next_serial{0};  // only tells tasks apart; orders nothing
  const TaskHandle handle(static_cast<std::uint32_t>(dag_.tasks.size()),
                          next_serial.fetch_add(1, std::memory_order_relaxed));
  bodies_.push_back(std::move(body));
  serials_.push_back(handle.serial_);
  sources_.emplace_back();
  dag_.tasks.push_back(std::move(task));
  return handle;
}

}  // namespace redag::runtime
