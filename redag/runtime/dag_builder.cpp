#include "redag/runtime/dag_builder.hpp"

#include <stdexcept>
#include <utility>

namespace redag::runtime {

DagBuilder::DagBuilder(std::string name, const DagOptions &options) {
  dag_.name = std::move(name);
  dag_.max_active = options.max_active;
  dag_.max_pending = options.max_pending;
  dag_.criticality = options.criticality;
}

TaskHandle DagBuilder::timer(std::string name, nanoseconds period, Function body, const TaskOptions &options) {
  Task &task = append(std::move(name), std::move(body), options);
  task.period = period.count();
  for (const TaskHandle handle : options.after) task.predecessors.push_back(handle.index_);
  return TaskHandle(static_cast<std::uint32_t>(dag_.tasks.size() - 1));
}

TaskHandle DagBuilder::data(std::string name, const std::vector<TaskHandle> &predecessors, Function body,
                            const TaskOptions &options) {
  Task &task = append(std::move(name), std::move(body), options);
  task.activation = Activation::Data;
  for (const TaskHandle handle : predecessors) task.predecessors.push_back(handle.index_);
  return TaskHandle(static_cast<std::uint32_t>(dag_.tasks.size() - 1));
}

Task &DagBuilder::append(std::string name, Function body, const TaskOptions &options) {
  if (!body) throw std::invalid_argument("task '" + name + "' has no body");
  Task task;
  task.name = std::move(name);
  task.wcet = options.wcet.count();
  task.deadline = options.deadline.count();
  task.offset = options.offset.count();
  task.budget = options.budget.count();
  task.overrun = options.overrun;
  task.queue_depth = options.queue_depth;
  task.priority = options.priority;
  task.group = options.group;
  bodies_.push_back(std::move(body));
  return dag_.tasks.emplace_back(std::move(task));
}

}  // namespace redag::runtime
