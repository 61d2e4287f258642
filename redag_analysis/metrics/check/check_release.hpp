// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The checker's rules about releases: the timer grid, precedence, overrun and admission. They see each event before the
// replay applies it. Internal to metrics/.
#pragma once

#include <cstdint>
#include <limits>
#include <vector>

#include "redag_analysis/metrics/check/check_context.hpp"

namespace redag::metrics {

class ReleaseRules {
 public:
  explicit ReleaseRules(CheckContext &context);

  void before(const JobEvent &event);
  /// Called before time moves on.
  void end_of_instant();
  void end_of_trace();

 private:
  struct Edge {
    TaskId from;
    TaskId to;
    bool aligned = false;  // timer to timer, same period and offset: only data of the same period counts
    bool fresh = false;    // a job completed since `to` last consumed
    Time release = std::numeric_limits<Time>::min();  // of the newest job that completed, whose data this is
    Time origin = 0;                                  // of that data
    Time finish = 0;                                  // of the job that completed last, as measured
    Time finish_decided = 0;                          // when the scheduler learned of it
  };
  // An edge between callbacks (trace::Edge). The trace does not say when messages come, so a job can begin later than
  // its predecessors allow, but never earlier.
  struct Link {
    trace::Edge edge;
    bool gives_back = false;  // `to` is a timer: a job skipped while it is ready has not used the data
    bool fresh = false;
  };
  // State of the task's releases that are refused (docs/model.md, "Budgets" and "Criticality").
  struct Refusals {
    bool skips_next = false;
    Time let_through = std::numeric_limits<Time>::min();  // HI mode: the newest release of the task that was taken;
                                                          // min(): none
  };
  struct TaskState {
    bool timer = true;
    bool on_grid = true;  // false: the program releases its jobs
    Overrun overrun = Overrun::Skip;
    std::uint32_t queue_depth = 0;
    std::vector<std::uint32_t> in;   // edges
    std::vector<std::uint32_t> out;  // edges
    std::vector<std::uint32_t> links_in;
    std::vector<std::uint32_t> links_out;
    std::uint32_t next_number = 0;
    Time data_origin = 0;  // of the data job that was released last
    bool touched = false;
    Refusals refusals;
  };
  struct ExpectedSkip {
    TaskId task;
    std::uint32_t number = 0;
    Reason reason = Reason::None;
  };

  void released(const JobEvent &event);
  void check_grid(const JobEvent &event);
  void check_data_release(const JobEvent &event);
  void expect_skips(const JobEvent &event);
  [[nodiscard]] Reason refusal(const JobEvent &event);
  [[nodiscard]] bool is_let_through(const JobEvent &event) const;
  void exceeded(const JobEvent &event);
  void mode_begins();
  void mode_ends();
  void ready(const JobEvent &event, const LiveJob &job);
  void follow_links(const JobEvent &event);
  void skipped(const JobEvent &event, const LiveJob *job);
  bool is_miss(const JobEvent &event) const;
  void finished(const JobEvent &event, const LiveJob &job);
  void check_nothing_is_owed(TaskId id);
  void touch(TaskId id);

  [[nodiscard]] bool is_fresh(const Edge &edge, Time release) const {
    return edge.fresh && (!edge.aligned || edge.release == release);
  }
  /// Returns the first predecessor without fresh data for a job released at `release`; none() if every one has it.
  [[nodiscard]] TaskId missing(const TaskState &task, Time release) const;
  Time consume(const TaskState &task);

  CheckContext &context_;
  std::vector<Edge> edges_;
  std::vector<Link> links_;
  std::vector<TaskState> tasks_;
  [[nodiscard]] bool is_removed(TaskId task) const {
    const std::size_t dag = context_.replay.dag_of(task).value;
    return removed_[dag] || removed_at_[dag] <= context_.now();
  }

  std::vector<bool> removed_;     // per DAG: a job was skipped for that reason
  std::vector<Time> removed_at_;  // per DAG, as the run says; kNever: it does not say
  std::vector<ExpectedSkip> expected_skips_;
  ExpectedSkip just_released_;  // by the last event; no task: the last event was no release
  std::vector<TaskId> touched_;
};

}  // namespace redag::metrics
