// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Plants in the hands of jobs: which job senses and which actuates, and when its effect begins. The one place where a
// schedule meets physics, for both worlds: virtual time reports when jobs start and end, threads call from inside them.
#pragma once

#include <memory>
#include <mutex>
#include <optional>
#include <vector>

#include "plants.hpp"
#include "redag/model/workload.hpp"

namespace closed_loop {

/// The task `sense` samples the state when its job starts. The task `control` takes the newest sample when its job
/// starts, and its control acts from when the job ends: a late job really acts late, a skipped one not at all.
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
  /// For recording, and at the end.
  template <class Look>
  void look(Time now, Look look) {
    const std::lock_guard<std::mutex> lock(mutex_);
    plant_.advance(now);
    look(plant_);
  }

 private:
  std::mutex mutex_;  // executors that know no max_active may run both tasks at once
  Plant plant_;
  std::optional<State> sample_;
  std::optional<State> input_;
};

enum class Role : std::uint8_t { None, Sense, Control };

struct TaskRole {
  Role role = Role::None;
  Loop *loop = nullptr;
};

/// The plants of one run.
class Loops {
 public:
  Loops(const std::vector<PlantSpec> &plants, std::uint64_t seed);

  /// By TaskId. Throws std::runtime_error if a plant has no DAG of its name with tasks `sense` and `control`.
  [[nodiscard]] std::vector<TaskRole> roles(const redag::Workload &workload) const;
  [[nodiscard]] const std::vector<std::unique_ptr<Loop>> &all() const { return loops_; }

 private:
  std::vector<PlantSpec> plants_;
  std::vector<std::unique_ptr<Loop>> loops_;
};

}  // namespace closed_loop
