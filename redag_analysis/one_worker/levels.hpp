// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// What can delay a task on one worker, by levels of urgency. A level is a tier; a task is of the level if its tier is
// at or above. Proofs: docs/analysis.md, "One worker". Not thread-safe.
#pragma once

#include <cstdint>
#include <vector>

#include "redag_analysis/core/bound.hpp"
#include "redag_analysis/one_worker/one_worker.hpp"

namespace redag::analysis::one_worker {

/// Work that a busy period contains at most once: the rest of a less urgent job that nothing preempts, and the tasks of
/// the level that its end releases.
struct Once {
  std::uint32_t task = 0;  // the less urgent one
  Duration stretch = 0;
  Duration follows = 0;
};

/// A part of a task's response, during which nothing below `level` runs. `own` is the work of its own instance until
/// the part ends: all of the level that does not follow the tasks with which it ends.
struct Stage {
  std::uint32_t level = 0;
  std::vector<std::uint32_t> own;  // TaskIds
};

class Levels {
 public:
  /// `task_set` must outlive this object. O(n log n + edges).
  explicit Levels(const TaskSet &task_set);

  /// The level of the task's first stage: the least urgent of the task and of its predecessors, direct or not.
  [[nodiscard]] std::uint32_t of(std::uint32_t task) const { return level_[task]; }
  /// The stages of the task's response, most often one. `in_order`: no two instances of its unit overlap.
  [[nodiscard]] std::vector<Stage> stages_of(std::uint32_t task, bool in_order) const;
  /// What the other units do in a busy period of the level, those of one period and jitter together. O(different
  /// periods), plus the steps from the level of the previous call.
  [[nodiscard]] std::vector<Interferer> others(std::uint32_t unit, std::uint32_t level);
  /// The work that a busy period of the level contains once, besides what `own` and instances of others contain
  /// already. `own` are tasks of the unit of `task`. O(tasks of units that the level divides, members of groups).
  [[nodiscard]] std::vector<Once> once(std::uint32_t task, std::uint32_t level,
                                       const std::vector<std::uint32_t> &own) const;
  /// What each instance of the unit does in a busy period of the level. O(tasks of the unit).
  [[nodiscard]] Duration volume(std::uint32_t unit, std::uint32_t level) const;

 private:
  [[nodiscard]] bool is_whole(const Unit &unit) const;
  void keep_units_whole();
  void find_counted(const Unit &unit);
  void find_level(const Unit &unit);
  [[nodiscard]] bool is_seen_apart(const Unit &unit) const;
  [[nodiscard]] std::vector<bool> after(std::uint32_t task, bool in_order) const;
  void find_longest();
  [[nodiscard]] static std::vector<Once> all_follow_once(std::vector<Once> all, std::vector<Once> stretches,
                                                         const Once &follow);
  template <class IsNew>
  [[nodiscard]] Once new_at(std::uint32_t level, IsNew is_new) const;

  const TaskSet &task_set_;
  std::vector<std::uint32_t> tier_;        // by TaskId; of a unit that is not divided, its least urgent
  std::vector<std::uint32_t> closed_;      // by tier: the first at or below it that divides no such unit
  std::vector<std::uint32_t> counted_;     // by TaskId: from this level on, each instance can do this task
  std::vector<std::uint32_t> level_;       // by TaskId
  std::vector<std::uint32_t> last_rank_;   // by tier
  std::vector<Once> longest_;              // by tier: the longest stretch below it that nothing preempts
  std::vector<std::uint32_t> divided_;     // units whose tasks have several tiers
  std::vector<Interferer> classes_;        // the units of one period and jitter, with the work that is summed up
  std::vector<std::uint32_t> class_of_;    // by unit
  std::vector<std::uint32_t> by_counted_;  // TaskIds
  std::size_t summed_ = 0;                 // this many of by_counted_ are in classes_
};

}  // namespace redag::analysis::one_worker
