// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Precedence inside DAGs: which predecessor's data a task has not consumed yet. Knows edges and nothing of jobs' lives,
// workers or priorities.
#pragma once

#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "redag/model/workload.hpp"

namespace redag::sched {

class Precedence {
 public:
  /// Adds the DAG's tasks, which are new or forgotten ones, and its edges; `ids` in the order of its tasks. Allocates.
  void add_dag(const Dag &dag, std::span<const TaskId> ids);
  /// Adds a task without edges. Allocates.
  void add_task(const Task &task, TaskId id) { add_node(task, id); }
  /// Takes away tasks, and the edges into and out of them: their ids can be added again. Linear in all edges.
  void forget(std::span<const TaskId> tasks);
  /// Which edges join tasks of one period and offset is found anew; data that came keeps its state. Linear in all
  /// edges.
  void set_period(TaskId task, Duration period);

  /// `task` has a new job, released at `release`.
  /// Returns whether all its predecessors have fresh data.
  bool on_release(TaskId task, Time release);

  struct Data {
    Time origin = 0;    // the earliest
    Time complete = 0;  // when the last of it was there; threads can report the end of an earlier job later
  };
  /// The waiting or newly released job of `task` takes its predecessors' data. Requires at least one predecessor.
  Data consume(TaskId task);

  /// The job that consumed last was skipped before it started: its data is fresh again.
  void give_back(TaskId task);

  /// Data that `task` has not consumed is forgotten.
  void discard(TaskId task);

  /// A job of `task`, released at `release` with data from `origin`, completed at `finish`. Calls on_fresh(successor)
  /// for each successor all of whose predecessors now have fresh data.
  template <class OnFresh>
  void on_complete(TaskId task, Time release, Time origin, Time finish, OnFresh on_fresh) {
    const Node node = nodes_[task.value];
    for (std::uint32_t i = node.first_successor; i < node.last_successor; ++i) {
      Edge &edge = edges_[successors_[i]];
      Node &successor = nodes_[edge.to.value];
      if (serves(edge, successor)) --successor.fresh;
      edge.finish = finish;
      if (release >= edge.release) {  // an older job that ends late does not replace newer data
        edge.release = release;
        edge.origin = origin;
      }
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
    TaskId to;                                        // none: forgotten
    bool aligned = false;                             // timer to timer, same period and offset: job k waits for job k
    bool fresh = false;                               // completed since `to` last consumed
    Time release = std::numeric_limits<Time>::min();  // of the newest job of the predecessor that completed: its data
    Time origin = 0;                                  // of that data
    Time finish = 0;                                  // of the job that completed last
  };
  struct Node {
    std::uint32_t first_edge = 0;  // edges into the task: [first_edge, last_edge)
    std::uint32_t last_edge = 0;
    std::uint32_t first_successor = 0;  // edges out of it: successors_[first_successor .. last_successor)
    std::uint32_t last_successor = 0;
    std::uint32_t fresh = 0;  // edges into the task with fresh data for its last job
    Time last_release = 0;    // of that job
    Duration period = 0;
    Duration offset = 0;
    bool timer = true;
  };

  /// Is there data for the successor's last job?
  [[nodiscard]] static bool serves(const Edge &edge, const Node &successor) {
    return edge.fresh && (!edge.aligned || edge.release == successor.last_release);
  }
  [[nodiscard]] bool count_fresh(Node &node);
  Node &add_node(const Task &task, TaskId id);
  [[nodiscard]] static bool is_aligned(const Node &from, const Node &to);

  std::vector<Node> nodes_;  // by TaskId
  std::vector<Edge> edges_;
  std::vector<std::uint32_t> successors_;
};

}  // namespace redag::sched
