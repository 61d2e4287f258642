// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// How long a job whose task shares exclusive groups can take, given the responses of all that can go first. The window
// runs from its release or its readiness to its end or its first tick of execution. Proof: docs/analysis.md, "Exclusive
// groups". Values and pure functions; not thread-safe (scratch).
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "redag_analysis/core/task_set.hpp"
#include "redag_analysis/many_workers/global.hpp"

namespace redag::analysis::groups {

/// More instances of a unit in one window, or a longer response in periods, count as no bound.
inline constexpr std::uint32_t kMostInstances = 16;

/// Units that share a priority level, or whose priorities are interleaved. They rely on each other: any of them can go
/// first.
struct Block {
  std::size_t begin = 0;  // positions in global::Units::units
  std::size_t end = 0;
};

/// Returns the blocks in order of priority; a single block of all units if priorities are not static.
[[nodiscard]] std::vector<Block> blocks_of(const TaskSet &task_set, const std::vector<global::GlobalUnit> &units);

/// What is known of a task.
struct TaskBound {
  Duration response = 0;  // from its unit's nominal release to its end
  Duration wait = 0;      // from when a job of it could start to its first tick, inclusive
};

/// One question: when does a job of `task` end?
struct Question {
  std::uint32_t task = 0;
  std::uint32_t instances = 1;  // of the unit on the chain; one more than the times that a job waits for its task's
                                // previous one
  bool from_ready = false;      // count from readiness, not from the release of the chain's first job
  bool first_tick = false;      // count to the first tick, not to the end
  Duration until = 0;           // the latest instant after its release that matters; 0: its response
};

/// The chain that answers a question, and what can delay the chain in any window.
struct Chain {
  struct Group {
    std::uint32_t group = 0;
    std::vector<std::uint32_t> waiters = {};             // tasks of the chain: each can find one less urgent holder
    Duration found = 0;                                  // less urgent holders that the chain finds
    Duration own_waiting = 0;                            // further own jobs that can find one
    std::uint32_t own_tasks = 0;                         // own tasks that go first
    Duration own_work = 0;                               // their work in the window
    std::optional<std::uint32_t> holder = std::nullopt;  // the longest less urgent member
    Duration held = 0;                                   // what is left of it once it has started
    Duration below = 0;                                  // the same, if it belongs to a less urgent unit
    Duration own_holding = 0;                            // work of own less urgent members in the window
  };
  Question question;
  std::size_t unit = 0;       // position
  Duration path = 0;          // the longest path of one instance
  Duration overhead = 0;      // the platform's part of it
  Duration length = 0;        // the chain: that path, and a repeated task for each further instance
  Duration own_jobs = 0;      // own jobs in progress in the window
  Duration longest = 0;       // the chain's longest length if all other own work counts
  Duration own = 0;           // all own work that can execute in the window, including the chain's
  Duration beside = 0;        // the part of `own` that can execute while the chain waits for workers
  Duration own_serial = 0;    // the part of `own` that the chain can wait for in groups
  Duration holders = 0;       // less urgent jobs that the chain waits for
  std::vector<Group> groups;  // those with a waiter, or with a less urgent member
};

/// How the time of a window is spent; `shared` sums are still to be divided by the workers.
struct Shares {
  Duration executes = 0;  // the chain, and own jobs that it waits for
  Duration own_shared = 0;
  std::vector<Duration> serial;  // by position of the more urgent unit
  std::vector<Duration> shared;
  Duration less_urgent = 0;  // jobs that inherited, or that had started and run to completion; shared
};

class Windows {
 public:
  Windows(const TaskSet &task_set, std::vector<global::GlobalUnit> &units);

  [[nodiscard]] const std::vector<Block> &blocks() const { return blocks_; }
  [[nodiscard]] TaskBound &of(std::uint32_t task) { return bounds_[task]; }
  [[nodiscard]] const TaskBound &bound_of(std::uint32_t task) const { return bounds_[task]; }
  /// Sets bounds to begin with, at or below all that agree.
  void start(std::size_t unit);
  [[nodiscard]] bool follows(std::size_t unit, std::uint32_t before, std::uint32_t after) const;

  [[nodiscard]] Chain chain_of(std::size_t block, std::size_t unit, const Question &question) const;
  /// Returns the least window that holds, or nothing if it is above `stop`. Leaves its shares in shares().
  [[nodiscard]] std::optional<Duration> window_of(std::size_t block, const Chain &chain, Duration stop);
  [[nodiscard]] const Shares &shares() const { return shares_; }

 private:
  // The tasks of a unit that are members of one group.
  struct Part {
    std::size_t unit = 0;
    Duration volume = 0;
    std::vector<std::uint32_t> tasks;
  };

  [[nodiscard]] std::uint32_t threshold(std::size_t unit, const Question &question) const;
  [[nodiscard]] Duration overlaps(Duration response, Duration period, Duration wcet) const;
  void add_own(std::size_t unit, std::uint32_t threshold, Chain &chain) const;
  void add_length(std::size_t unit, Chain &chain) const;
  [[nodiscard]] bool is_earlier_done(std::size_t unit, const Question &question, std::uint32_t task) const;
  void take_longer(std::uint32_t task, std::optional<std::uint32_t> &longest) const;
  [[nodiscard]] Duration least_window(std::size_t block, const Chain &chain);
  void share_own(const Chain &chain, Duration together);
  [[nodiscard]] Duration evaluate(std::size_t block, const Chain &chain, Duration x);
  [[nodiscard]] Duration work(std::size_t unit, Duration x) const;
  [[nodiscard]] Duration serial_work(const Part &part, Duration x) const;
  [[nodiscard]] Duration jobs_in_progress(const Part &part, Duration x) const;
  [[nodiscard]] bool obeys_levels(std::size_t unit) const;
  [[nodiscard]] bool is_beside(std::size_t unit, const Question &question, std::uint32_t task) const;

  const TaskSet &task_set_;
  std::vector<global::GlobalUnit> &units_;
  std::vector<Block> blocks_;
  bool preempts_;
  std::vector<TaskBound> bounds_;                                         // by TaskId
  std::vector<std::vector<std::vector<bool>>> reachable_;                 // by position: from and to places in
                                                                          // Unit::tasks
  std::vector<std::uint32_t> place_;                                      // by TaskId
  std::vector<std::vector<Part>> parts_;                                  // by group, in order of position
  std::vector<std::vector<std::optional<std::uint32_t>>> longest_below_;  // by block, then group: the longest less
                                                                          // urgent member
  std::vector<Duration> first_blocking_;                                  // by block: first blocking by jobs that run
                                                                          // to completion
  std::vector<Duration> later_blocking_;
  Shares shares_;
  std::vector<Duration> volumes_;  // scratch of least_window()
};

}  // namespace redag::analysis::groups
