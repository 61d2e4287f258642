// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Connects plants with jobs: which job senses, which actuates, and when its effect begins. This is the one place where
// a schedule meets physics, in both worlds. Virtual time reports when jobs start and end; threads call from inside the
// jobs.
#pragma once

#include <memory>
#include <mutex>
#include <optional>
#include <vector>

#include "plants.hpp"
#include "redag/model/workload.hpp"

namespace closed_loop {

/// One plant and its feedback. The task `sense` samples the state when its job starts. The task `control` takes the
/// newest sample when its job starts, and actuates when the job ends. A late job therefore acts late, and a skipped one
/// not at all.
class Loop {
 public:
  Loop(const PlantSpec &spec, std::uint64_t seed) : plant_(spec, seed) {}

  void sense(Time now) {
    const std::lock_guard<std::mutex> lock(mutex_);
    plant_.advance(now);
    sample_ = plant_.state();
  }
  void begin_control() {
    const std::lock_guard<std::mutex> lock(mutex_);
    input_ = sample_;
  }
  void end_control(Time now) {
    const std::lock_guard<std::mutex> lock(mutex_);
    plant_.advance(now);
    if (input_) plant_.actuate(plant_.feedback(*input_));
  }
  /// Calls look(plant) at `now`, for recording and for the final figures.
  template <class Look>
  void look(Time now, Look look) {
    const std::lock_guard<std::mutex> lock(mutex_);
    plant_.advance(now);
    look(plant_);
  }

 private:
  std::mutex mutex_;  // executors that ignore max_active may run both tasks at once
  Plant plant_;
  std::optional<State> sample_;
  std::optional<State> input_;
};

enum class Role : std::uint8_t { None, Sense, Control };

struct TaskRole {
  Role role = Role::None;
  Loop *loop = nullptr;
};

/// Holds the plants of one run.
class Loops {
 public:
  Loops(const std::vector<PlantSpec> &plants, std::uint64_t seed);

  /// Returns the role of each task, by TaskId. Throws std::runtime_error if a plant has no DAG of its name with tasks
  /// `sense` and `control`.
  [[nodiscard]] std::vector<TaskRole> roles(const redag::Workload &workload) const;
  [[nodiscard]] const std::vector<std::unique_ptr<Loop>> &all() const { return loops_; }

 private:
  std::vector<PlantSpec> plants_;
  std::vector<std::unique_ptr<Loop>> loops_;
};

}  // namespace closed_loop
