#include "redag/sched/precedence.hpp"

#include <algorithm>
#include <limits>

namespace redag::sched {
namespace {

bool is_aligned(const Task &from, const Task &to) {
  return from.activation == Activation::Timer && to.activation == Activation::Timer && from.period == to.period &&
         from.offset == to.offset;
}

}  // namespace

void Precedence::add_dag(const Dag &dag) {
  const auto first_task = static_cast<std::uint32_t>(nodes_.size());
  std::vector<std::vector<std::uint32_t>> outgoing(dag.tasks.size());
  for (std::uint32_t i = 0; i < dag.tasks.size(); ++i) {
    const Task &task = dag.tasks[i];
    Node node;
    node.last_release = std::numeric_limits<Time>::min();
    node.first_edge = static_cast<std::uint32_t>(edges_.size());
    for (const std::uint32_t p : task.predecessors) {
      outgoing[p].push_back(static_cast<std::uint32_t>(edges_.size()));
      edges_.push_back(Edge{TaskId(first_task + i), is_aligned(dag.tasks[p], task), false, 0, 0});
    }
    node.last_edge = static_cast<std::uint32_t>(edges_.size());
    nodes_.push_back(node);
  }
  for (std::uint32_t i = 0; i < dag.tasks.size(); ++i) {
    Node &node = nodes_[first_task + i];
    node.first_successor = static_cast<std::uint32_t>(successors_.size());
    successors_.insert(successors_.end(), outgoing[i].begin(), outgoing[i].end());
    node.last_successor = static_cast<std::uint32_t>(successors_.size());
  }
}

bool Precedence::on_release(TaskId task, Time release) {
  Node &node = nodes_[task.value];
  node.last_release = release;
  for (std::uint32_t i = node.first_edge; i < node.last_edge; ++i) {
    Edge &edge = edges_[i];
    if (edge.aligned && edge.fresh && edge.release < release) {
      edge.fresh = false;
      --node.fresh;
    }
  }
  return node.fresh == node.last_edge - node.first_edge;
}

Time Precedence::consume(TaskId task) {
  Node &node = nodes_[task.value];
  Time origin = kNever;
  for (std::uint32_t i = node.first_edge; i < node.last_edge; ++i) {
    edges_[i].fresh = false;
    origin = std::min(origin, edges_[i].origin);
  }
  node.fresh = 0;
  return origin;
}

void Precedence::give_back(TaskId task) {
  Node &node = nodes_[task.value];
  for (std::uint32_t i = node.first_edge; i < node.last_edge; ++i) edges_[i].fresh = true;
  node.fresh = node.last_edge - node.first_edge;
}

}  // namespace redag::sched
