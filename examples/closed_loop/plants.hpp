// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The plants: cart-poles with poles of several lengths and a planar quadrotor, as MuJoCo models, and the feedback that
// keeps them upright. A plant's time is virtual or wall-clock time, as the caller chooses. Each call that senses or
// actuates steps the physics exactly to "now".
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
  std::string name;  // also the name of its DAG in the workload
  Kind kind = Kind::CartPole;
  double length = 0.5;  // m; the pole's length, or the length of the quadrotor's arm
  Duration period = 0;  // of its feedback
  double push = 0;      // rad/s; largest change of a push to the angular velocity of pole or pitch
};

/// Returns MuJoCo's model file of one scene with the plants side by side.
[[nodiscard]] std::string mjcf(const std::vector<PlantSpec> &plants);

struct ModelDeleter {
  void operator()(mjModel *model) const { mj_deleteModel(model); }
  void operator()(mjData *data) const { mj_deleteData(data); }
};
using Model = std::unique_ptr<mjModel, ModelDeleter>;
using Data = std::unique_ptr<mjData, ModelDeleter>;

/// Compiles a model. Throws std::runtime_error with MuJoCo's message.
[[nodiscard]] Model compile(const std::string &mjcf);

using State = std::vector<double>;  // positions, then velocities, as differences from upright and at rest

class Plant {
 public:
  /// `seed` draws the pushes. Their times do not depend on the control.
  Plant(const PlantSpec &spec, std::uint64_t seed);

  /// Advances the physics to `now` under the latest control. Does nothing if `now` has passed.
  void advance(Time now);
  [[nodiscard]] State state() const;
  /// Applies a control from the current time on.
  void actuate(const std::vector<double> &control);
  /// Returns u = u0 - K x. The gain minimises the sum of x'Qx + u'Ru at the period of the feedback, without delay.
  [[nodiscard]] std::vector<double> feedback(const State &state) const;

  [[nodiscard]] const PlantSpec &spec() const { return spec_; }
  [[nodiscard]] Time time() const { return time_; }
  /// The angle of the pole, or the quadrotor's pitch, in rad.
  [[nodiscard]] double angle() const;
  /// The position of the cart or the quadrotor, in m.
  [[nodiscard]] double position() const;
  [[nodiscard]] double height() const;  // m, of the quadrotor above its hovering point
  /// The mean of x'Qx + u'Ru over the time so far. While the plant is down, the value at its fall counts.
  [[nodiscard]] double cost() const;
  /// The number of falls. A plant falls when it leaves its allowed range; it then stays down for half a second.
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
