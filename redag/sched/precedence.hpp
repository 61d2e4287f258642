// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Tracks precedence inside DAGs: which data of its predecessors a task has not consumed yet. It knows edges, and
// nothing of job states, workers or priorities. Not thread-safe.
#pragma once

#include <algorithm>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "redag/model/workload.hpp"

namespace redag::sched {

class Precedence {
 public:
  /// Adds a DAG's tasks and edges. `ids` are the tasks' ids in their order, each new or forgotten. Allocates.
  void add_dag(const Dag &dag, std::span<const TaskId> ids);
  /// Adds a task whose releases come from outside: it has no grid, and no edge of it is aligned. A data task gets an
  /// edge for its messages. Allocates.
  void add_task(const Task &task, TaskId id);
  /// Replaces the predecessors of a task that add_task() added. Edges that stay keep their data. Returns true if all
  /// data of its last job is fresh now, or of its next one for a data task. Linear in all edges.
  bool set_predecessors(TaskId task, std::span<const TaskId> predecessors);
  /// Removes tasks with their incoming and outgoing edges. Their ids can be added again. Linear in all edges.
  void forget(std::span<const TaskId> tasks);
  /// Changes a task's period and finds again which edges are aligned. Data that has arrived keeps its state. Linear in
  /// all edges.
  void set_period(TaskId task, Duration period);

  /// Records a new job of `task`, released at `release`. Returns true if all its predecessors have fresh data.
  bool on_release(TaskId task, Time release);

  /// Records that a message for data task `task` came at `at`, with data from `origin`. If a job of `sender` is sending
  /// it, earlier data of that predecessor no longer serves: the message waits for the end of its own sender. Returns
  /// true if all data is fresh now. A message from before the data that was consumed last changes nothing, because a
  /// job has used it or one that came later.
  bool on_message(TaskId task, TaskId sender, Time at, Time origin);

  struct Data {
    Time origin = 0;    // the earliest origin of the data
    Time complete = 0;  // the latest finish of all predecessors; threads can report an earlier finish later
  };
  /// The waiting or newly released job of `task` consumes its predecessors' data. Requires at least one predecessor.
  Data consume(TaskId task) {
    Node &node = nodes_[task.value];
    Data data{kNever, std::numeric_limits<Time>::min()};
    for (std::uint32_t i = node.first_edge; i < node.last_edge; ++i) {
      edges_[i].fresh = false;
      data.origin = std::min(data.origin, edges_[i].origin);
      data.complete = std::max(data.complete, edges_[i].finish);
    }
    node.fresh = 0;
    node.consumed = data.complete;
    return data;
  }

  /// Finds the heir of each task: its only successor, if that is a data task without other predecessors, and
  /// may_inherit(task, successor) is true. To be called after each change. Linear in the tasks.
  template <class MayInherit>
  void find_heirs(MayInherit may_inherit) {
    for (std::uint32_t t = 0; t < nodes_.size(); ++t) {
      Node &node = nodes_[t];
      node.heir = TaskId();
      if (node.last_successor - node.first_successor != 1) continue;
      node.heir_edge = successors_[node.first_successor];
      const TaskId to = edges_[node.heir_edge].to;
      const Node &successor = nodes_[to.value];
      const bool is_alone = !successor.timer && successor.last_edge - successor.first_edge == 1;
      if (is_alone && may_inherit(TaskId(t), to)) node.heir = to;
    }
  }
  /// The heir of the task, or no task.
  [[nodiscard]] TaskId heir(TaskId task) const { return nodes_[task.value].heir; }
  /// As on_complete(), and consume() for the heir of the task, which it must have.
  Data hand_on(TaskId task, Time release, Time origin, Time finish) {
    Edge &edge = edges_[nodes_[task.value].heir_edge];
    edge.take(release, origin, finish);
    return Data{edge.origin, finish};
  }

  /// Makes the consumed data fresh again: the job that consumed it was skipped before it started.
  void give_back(TaskId task);

  /// Discards the data that `task` has not consumed.
  void discard(TaskId task);

  /// Records that a job of `task`, released at `release` with data from `origin`, completed at `finish`. Calls
  /// on_fresh(successor) for each successor whose predecessors now all have fresh data.
  template <class OnFresh>
  void on_complete(TaskId task, Time release, Time origin, Time finish, OnFresh on_fresh) {
    const std::uint32_t last = nodes_[task.value].last_successor;
    for (std::uint32_t i = nodes_[task.value].first_successor; i < last; ++i) {
      Edge &edge = edges_[successors_[i]];
      Node &successor = nodes_[edge.to.value];
      if (serves(edge, successor)) --successor.fresh;
      edge.take(release, origin, finish);
      edge.fresh = true;
      if (serves(edge, successor)) ++successor.fresh;
      if (successor.fresh == successor.last_edge - successor.first_edge) on_fresh(edge.to);
    }
  }

  [[nodiscard]] bool has_predecessors(TaskId task) const {
    return nodes_[task.value].first_edge != nodes_[task.value].last_edge;
  }

 private:
  struct Edge {
    TaskId to;                                        // the successor; invalid: the edge is forgotten
    TaskId from;                                      // the predecessor; invalid: messages of `to`
    bool aligned = false;                             // timer to timer, same period and offset: job k waits for job k
    bool fresh = false;                               // the predecessor completed since `to` last consumed
    Time release = std::numeric_limits<Time>::min();  // of the predecessor's newest completed job: its data
    Time origin = 0;                                  // of that data
    Time finish = 0;                                  // of the job whose end was reported last

    /// A job of the predecessor has completed. An older job that ends late does not replace newer data.
    void take(Time its_release, Time its_origin, Time its_finish) {
      finish = its_finish;
      if (its_release < release) return;
      release = its_release;
      origin = its_origin;
    }
  };
  struct Node {
    std::uint32_t first_edge = 0;  // edges into the task: [first_edge, last_edge)
    std::uint32_t last_edge = 0;
    std::uint32_t first_successor = 0;  // edges out of it: successors_[first_successor .. last_successor)
    std::uint32_t last_successor = 0;
    std::uint32_t fresh = 0;  // number of incoming edges with fresh data for its last job
    TaskId heir;
    Time last_release = 0;                             // of that job
    Time consumed = std::numeric_limits<Time>::min();  // Data::complete of what was consumed last
    Duration period = 0;
    Duration offset = 0;
    bool timer = true;
    bool on_grid = true;          // its releases are points of its grid
    std::uint32_t heir_edge = 0;  // from the task to its heir
  };

  /// Returns true if the edge has data for the successor's last job.
  [[nodiscard]] static bool serves(const Edge &edge, const Node &successor) {
    return edge.fresh && (!edge.aligned || edge.release == successor.last_release);
  }
  [[nodiscard]] bool count_fresh(Node &node);
  Node &add_node(const Task &task, TaskId id);
  void store(const std::vector<std::vector<Edge>> &incoming);
  [[nodiscard]] static bool is_aligned(const Node &from, const Node &to);

  std::vector<Node> nodes_;  // by TaskId
  std::vector<Edge> edges_;
  std::vector<std::uint32_t> successors_;
};

}  // namespace redag::sched
