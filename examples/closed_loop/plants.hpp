// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The plants: cart-poles with poles of several lengths and a planar quadrotor, as MuJoCo models, and the feedback that
// keeps them upright. A plant's time is virtual or wall-clock time, whatever calls it: physics is stepped to "now" when
// somebody senses or actuates, never later than the clock and never ahead of it.
#pragma once

#include <mujoco/mujoco.h>

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "redag/base/time.hpp"

namespace closed_loop {

using redag::Duration;
using redag::Time;

struct PlantSpec {
  enum class Kind : std::uint8_t { CartPole, Quadrotor };
  std::string name;  // of its DAG in the workload
  Kind kind = Kind::CartPole;
  double length = 0.5;  // m: of the pole; of the quadrotor's arm
  Duration period = 0;  // of its feedback
  double push = 0;      // rad/s (cart-pole: pole; quadrotor: pitch): largest change of angular velocity by a push
};

/// Models by name in one scene, beside each other.
[[nodiscard]] std::string mjcf(const std::vector<PlantSpec> &plants);

struct ModelDeleter {
  void operator()(mjModel *model) const { mj_deleteModel(model); }
  void operator()(mjData *data) const { mj_deleteData(data); }
};
using Model = std::unique_ptr<mjModel, ModelDeleter>;
using Data = std::unique_ptr<mjData, ModelDeleter>;

/// Throws std::runtime_error with MuJoCo's words.
[[nodiscard]] Model compile(const std::string &mjcf);

using State = std::vector<double>;  // positions, then velocities, as differences from upright and at rest

class Plant {
 public:
  /// `seed`: of the pushes, which come at their times whatever the control does.
  Plant(const PlantSpec &spec, std::uint64_t seed);

  /// Moves physics to `now` under the control that was given last; does nothing for times that are past.
  void advance(Time now);
  [[nodiscard]] State state() const;
  /// From now on.
  void actuate(const std::vector<double> &control);
  /// u = u0 - K x. The gain minimises the sum of x'Qx + u'Ru at the period of the feedback, without delay.
  [[nodiscard]] std::vector<double> feedback(const State &state) const;

  [[nodiscard]] const PlantSpec &spec() const { return spec_; }
  [[nodiscard]] Time time() const { return time_; }
  /// Of the pole, or the quadrotor's pitch; rad.
  [[nodiscard]] double angle() const;
  /// Of the cart, or the quadrotor; m.
  [[nodiscard]] double position() const;
  [[nodiscard]] double height() const;  // of the quadrotor above where it hovers
  /// Mean of x'Qx + u'Ru over the time so far; while down, what it was when it fell.
  [[nodiscard]] double cost() const;
  /// How often it left the range from which anybody would pick it up: it then stays down for half a second.
  [[nodiscard]] std::uint32_t falls() const { return falls_; }
  [[nodiscard]] bool is_down() const { return time_ < down_until_; }

 private:
  void step(Duration length);
  void push();
  void stand_up();
  [[nodiscard]] double stage_cost() const;
  [[nodiscard]] bool has_fallen() const;
  [[nodiscard]] Time push_time(std::uint64_t index) const;

  PlantSpec spec_;
  std::uint64_t seed_;
  Model model_;
  Data data_;
  std::vector<double> weights_;            // Q, diagonal
  double control_weight_ = 0;              // R
  std::vector<double> hover_;              // u0
  std::vector<std::vector<double>> gain_;  // K
  Time time_ = 0;
  Time down_until_ = 0;
  std::uint64_t pushes_ = 0;
  std::uint32_t falls_ = 0;
  double cost_ = 0;  // integral over seconds
};

}  // namespace closed_loop
