// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/sched/precedence.hpp"

#include <algorithm>
#include <limits>
#include <utility>

namespace redag::sched {

Precedence::Node &Precedence::add_node(const Task &task, TaskId id) {
  if (id.value >= nodes_.size()) nodes_.resize(id.value + 1);
  Node &node = nodes_[id.value];
  node = Node{};
  node.last_release = std::numeric_limits<Time>::min();
  node.period = task.period;
  node.offset = task.offset;
  node.timer = task.activation == Activation::Timer;
  return node;
}

bool Precedence::is_aligned(const Node &from, const Node &to) {
  const bool on_grid = from.timer && from.on_grid && to.timer && to.on_grid;
  return on_grid && from.period == to.period && from.offset == to.offset;
}

void Precedence::add_task(const Task &task, TaskId id) {
  Node &node = add_node(task, id);
  node.on_grid = false;
  node.first_edge = node.last_edge = static_cast<std::uint32_t>(edges_.size());
  if (node.timer) return;
  edges_.push_back(Edge{.to = id, .from = TaskId()});
  ++node.last_edge;
}

void Precedence::add_dag(const Dag &dag, std::span<const TaskId> ids) {
  for (std::size_t i = 0; i < ids.size(); ++i) add_node(dag.tasks[i], ids[i]);
  std::vector<std::vector<std::uint32_t>> outgoing(dag.tasks.size());
  for (std::size_t i = 0; i < ids.size(); ++i) {
    Node &node = nodes_[ids[i].value];
    node.first_edge = static_cast<std::uint32_t>(edges_.size());
    for (const std::uint32_t p : dag.tasks[i].predecessors) {
      outgoing[p].push_back(static_cast<std::uint32_t>(edges_.size()));
      edges_.push_back(Edge{.to = ids[i], .from = ids[p], .aligned = is_aligned(nodes_[ids[p].value], node)});
    }
    node.last_edge = static_cast<std::uint32_t>(edges_.size());
  }
  for (std::size_t i = 0; i < ids.size(); ++i) {
    Node &node = nodes_[ids[i].value];
    node.first_successor = static_cast<std::uint32_t>(successors_.size());
    successors_.insert(successors_.end(), outgoing[i].begin(), outgoing[i].end());
    node.last_successor = static_cast<std::uint32_t>(successors_.size());
  }
}

void Precedence::forget(std::span<const TaskId> tasks) {
  std::vector<bool> gone(nodes_.size(), false);
  for (const TaskId task : tasks) {
    gone[task.value] = true;
    nodes_[task.value] = Node{};
  }
  std::vector<std::vector<Edge>> incoming(nodes_.size());
  for (const Edge &edge : edges_) {
    const bool kept = !gone[edge.to.value] && (!edge.from.valid() || !gone[edge.from.value]);
    if (kept) incoming[edge.to.value].push_back(edge);
  }
  store(incoming);
}

bool Precedence::set_predecessors(TaskId task, std::span<const TaskId> predecessors) {
  std::vector<std::vector<Edge>> incoming(nodes_.size());
  for (const Edge &edge : edges_) incoming[edge.to.value].push_back(edge);
  std::vector<Edge> &its = incoming[task.value];
  std::erase_if(its, [&](const Edge &edge) {
    return edge.from.valid() && std::find(predecessors.begin(), predecessors.end(), edge.from) == predecessors.end();
  });
  for (const TaskId from : predecessors) {
    const bool known = std::any_of(its.begin(), its.end(), [&](const Edge &edge) { return edge.from == from; });
    if (!known) its.push_back(Edge{.to = task, .from = from});
  }
  store(incoming);
  return count_fresh(nodes_[task.value]);
}

// Replaces all edges, in their order by successor. Removed ones cost no storage.
void Precedence::store(const std::vector<std::vector<Edge>> &incoming) {
  edges_.clear();
  successors_.clear();
  std::vector<std::vector<std::uint32_t>> outgoing(nodes_.size());
  for (std::size_t t = 0; t < nodes_.size(); ++t) {
    Node &node = nodes_[t];
    node.first_edge = static_cast<std::uint32_t>(edges_.size());
    for (const Edge &edge : incoming[t]) {
      if (edge.from.valid()) outgoing[edge.from.value].push_back(static_cast<std::uint32_t>(edges_.size()));
      edges_.push_back(edge);
    }
    node.last_edge = static_cast<std::uint32_t>(edges_.size());
    static_cast<void>(count_fresh(node));
  }
  for (std::size_t t = 0; t < nodes_.size(); ++t) {
    nodes_[t].first_successor = static_cast<std::uint32_t>(successors_.size());
    successors_.insert(successors_.end(), outgoing[t].begin(), outgoing[t].end());
    nodes_[t].last_successor = static_cast<std::uint32_t>(successors_.size());
  }
}

void Precedence::set_period(TaskId task, Duration period) {
  nodes_[task.value].period = period;
  for (const Node &from : nodes_) {
    for (std::uint32_t i = from.first_successor; i < from.last_successor; ++i) {
      Edge &edge = edges_[successors_[i]];
      edge.aligned = is_aligned(from, nodes_[edge.to.value]);
    }
  }
  for (Node &node : nodes_) static_cast<void>(count_fresh(node));
}

// Recounts the edges with fresh data; returns true if all have it.
bool Precedence::count_fresh(Node &node) {
  node.fresh = 0;
  for (std::uint32_t i = node.first_edge; i < node.last_edge; ++i) node.fresh += serves(edges_[i], node) ? 1U : 0U;
  return node.fresh == node.last_edge - node.first_edge;
}

bool Precedence::on_release(TaskId task, Time release) {
  Node &node = nodes_[task.value];
  node.last_release = release;
  return count_fresh(node);
}

bool Precedence::on_message(TaskId task, TaskId sender, Time at, Time origin) {
  Node &node = nodes_[task.value];
  if (at <= node.consumed) return false;
  for (std::uint32_t i = node.first_edge; i < node.last_edge; ++i) {
    Edge &edge = edges_[i];
    if (edge.from.valid() && edge.from == sender) edge.fresh = false;
    if (edge.from.valid()) continue;
    edge.take(at, origin, at);
    edge.fresh = true;
  }
  return count_fresh(node);
}

void Precedence::discard(TaskId task) {
  Node &node = nodes_[task.value];
  for (std::uint32_t i = node.first_edge; i < node.last_edge; ++i) edges_[i].fresh = false;
  node.fresh = 0;
}

void Precedence::give_back(TaskId task) {
  Node &node = nodes_[task.value];
  for (std::uint32_t i = node.first_edge; i < node.last_edge; ++i) edges_[i].fresh = true;
  static_cast<void>(count_fresh(node));
}

}  // namespace redag::sched
