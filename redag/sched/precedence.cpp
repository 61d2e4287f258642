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
  return from.timer && to.timer && from.period == to.period && from.offset == to.offset;
}

void Precedence::add_dag(const Dag &dag, std::span<const TaskId> ids) {
  for (std::size_t i = 0; i < ids.size(); ++i) add_node(dag.tasks[i], ids[i]);
  std::vector<std::vector<std::uint32_t>> outgoing(dag.tasks.size());
  for (std::size_t i = 0; i < ids.size(); ++i) {
    Node &node = nodes_[ids[i].value];
    node.first_edge = static_cast<std::uint32_t>(edges_.size());
    for (const std::uint32_t p : dag.tasks[i].predecessors) {
      outgoing[p].push_back(static_cast<std::uint32_t>(edges_.size()));
      edges_.push_back(Edge{ids[i], is_aligned(nodes_[ids[p].value], node)});
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

// Compacts the edge arrays so that removed tasks cost no storage.
void Precedence::forget(std::span<const TaskId> tasks) {
  for (const TaskId task : tasks) {
    Node &node = nodes_[task.value];
    for (std::uint32_t i = node.first_edge; i < node.last_edge; ++i) edges_[i].to = TaskId();
    node = Node{};
  }
  std::vector<Edge> edges;
  std::vector<std::uint32_t> successors;
  std::vector<std::uint32_t> new_place(edges_.size(), 0);
  for (Node &node : nodes_) {
    const auto first = static_cast<std::uint32_t>(edges.size());
    for (std::uint32_t i = node.first_edge; i < node.last_edge; ++i) {
      new_place[i] = static_cast<std::uint32_t>(edges.size());
      edges.push_back(edges_[i]);
    }
    node.first_edge = first;
    node.last_edge = static_cast<std::uint32_t>(edges.size());
  }
  for (Node &node : nodes_) {
    const auto first = static_cast<std::uint32_t>(successors.size());
    for (std::uint32_t i = node.first_successor; i < node.last_successor; ++i) {
      if (edges_[successors_[i]].to.valid()) successors.push_back(new_place[successors_[i]]);
    }
    node.first_successor = first;
    node.last_successor = static_cast<std::uint32_t>(successors.size());
  }
  edges_ = std::move(edges);
  successors_ = std::move(successors);
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
