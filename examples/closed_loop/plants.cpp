// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "plants.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <numbers>
#include <stdexcept>

#include "lqr.hpp"
#include "redag/derived/rng.hpp"

namespace closed_loop {
namespace {

constexpr Duration kStep = 250 * redag::kMicrosecond;       // of physics; the last step up to "now" is shorter
constexpr Duration kPushEvery = 500 * redag::kMillisecond;  // on average
constexpr Duration kDown = 500 * redag::kMillisecond;
constexpr double kFallenAngle = std::numbers::pi / 4;
constexpr double kRail = 1.0;      // m, to each side
constexpr double kAirspace = 1.5;  // m, on each side of the hovering point
constexpr double kGravity = 9.81;
constexpr double kBetween = 0.38;  // m, between neighbouring plants

// Mass in kg, which the quadrotor's thrust has to carry.
constexpr double kQuadrotorMass = 0.5;

std::string cart_pole(const PlantSpec &spec, double y) {
  const double mass = 0.1 * spec.length / 0.5;
  return fmt::format(
      R"(<body name="{0}" pos="0 {1:.3f} 0.12">
  <geom type="capsule" fromto="-0.8 0 -0.05 0.8 0 -0.05" size="0.008" rgba="0.6 0.6 0.65 1" mass="0"/>
  <body name="{0}_cart">
    <joint name="{0}_x" type="slide" axis="1 0 0" damping="0.1"/>
    <geom type="box" size="0.06 0.05 0.03" rgba="0.15 0.35 0.6 1" mass="0.5"/>
    <body name="{0}_pole">
      <joint name="{0}_angle" type="hinge" axis="0 1 0" damping="0.0002"/>
      <geom type="capsule" fromto="0 0 0 0 0 {2:.4f}" size="0.014" rgba="0.85 0.4 0.1 1" mass="{3:.4f}"/>
    </body>
  </body>
</body>
)",
      spec.name, y, spec.length, mass);
}

std::string quadrotor(const PlantSpec &spec, double y) {
  return fmt::format(
      R"(<body name="{0}" pos="0 {1:.3f} 0.75">
  <joint name="{0}_x" type="slide" axis="1 0 0"/>
  <joint name="{0}_z" type="slide" axis="0 0 1"/>
  <joint name="{0}_angle" type="hinge" axis="0 1 0"/>
  <geom type="box" size="{2:.4f} 0.03 0.015" rgba="0.25 0.25 0.28 1" mass="{3:.4f}"/>
  <geom type="cylinder" pos="-{2:.4f} 0 0.03" size="0.07 0.006" rgba="0.1 0.6 0.4 1" mass="0"/>
  <geom type="cylinder" pos="{2:.4f} 0 0.03" size="0.07 0.006" rgba="0.1 0.6 0.4 1" mass="0"/>
  <site name="{0}_left" pos="-{2:.4f} 0 0"/>
  <site name="{0}_right" pos="{2:.4f} 0 0"/>
</body>
)",
      spec.name, y, spec.length, kQuadrotorMass);
}

std::string motors(const PlantSpec &spec) {
  if (spec.kind == PlantSpec::Kind::CartPole) {
    return fmt::format("<motor joint=\"{}_x\" ctrllimited=\"true\" ctrlrange=\"-20 20\"/>\n", spec.name);
  }
  std::string text;
  for (const char *side : {"left", "right"}) {
    text += fmt::format("<motor site=\"{}_{}\" gear=\"0 0 1 0 0 0\" ctrllimited=\"true\" ctrlrange=\"0 {:.3f}\"/>\n",
                        spec.name, side, kQuadrotorMass * kGravity);
  }
  return text;
}

double seconds(Duration duration) { return static_cast<double>(duration) / redag::kSecond; }

}  // namespace

std::string mjcf(const std::vector<PlantSpec> &plants) {
  std::string bodies;
  std::string actuators;
  double y = 0;
  for (const PlantSpec &spec : plants) {
    bodies += spec.kind == PlantSpec::Kind::CartPole ? cart_pole(spec, y) : quadrotor(spec, y);
    actuators += motors(spec);
    y += kBetween;
  }
  return fmt::format(R"(<mujoco>
<option gravity="0 0 -{}" integrator="Euler"><flag contact="disable"/></option>
<visual><headlight ambient="0.45 0.45 0.45" diffuse="0.25 0.25 0.25"/><global offwidth="640" offheight="480"/><quality shadowsize="2048"/></visual>
<asset>
  <texture name="sky" type="skybox" builtin="gradient" rgb1="0.95 0.97 1" rgb2="0.75 0.82 0.9" width="64" height="64"/>
  <texture name="grid" type="2d" builtin="checker" rgb1="0.93 0.94 0.95" rgb2="0.87 0.88 0.9" width="256" height="256"/>
  <material name="floor" texture="grid" texrepeat="8 8"/>
</asset>
<worldbody>
<light pos="0 0 5" dir="0.2 0.35 -1" directional="true" diffuse="0.55 0.55 0.55" specular="0.1 0.1 0.1"/>
<geom type="plane" size="6 6 0.1" material="floor"/>
{}</worldbody>
<actuator>
{}</actuator>
</mujoco>
)",
                     kGravity, bodies, actuators);
}

Model compile(const std::string &text) {
  const std::string name = "plants.xml";
  const auto files = std::make_unique<mjVFS>();
  mj_defaultVFS(files.get());
  if (mj_makeEmptyFileVFS(files.get(), name.c_str(), static_cast<int>(text.size())) != 0) {
    throw std::runtime_error("MuJoCo: the model does not fit into memory");
  }
  std::memcpy(files->filedata[mj_findFileVFS(files.get(), name.c_str())], text.data(), text.size());
  std::string error(1024, '\0');
  Model model(mj_loadXML(name.c_str(), files.get(), error.data(), static_cast<int>(error.size())));
  mj_deleteVFS(files.get());
  if (!model) throw std::runtime_error(std::string("MuJoCo: ") + error.data());
  return model;
}

Plant::Plant(const PlantSpec &spec, std::uint64_t seed)
    : spec_(spec), seed_(seed), model_(compile(mjcf({spec}))), data_(mj_makeData(model_.get())) {
  const auto inputs = static_cast<std::size_t>(model_->nu);
  const auto states = 2 * static_cast<std::size_t>(model_->nv);
  if (spec.kind == PlantSpec::Kind::CartPole) {
    weights_ = {1, 10, 0.1, 0.1};  // x, angle, their velocities
    control_weight_ = 0.001;
    hover_ = {0};
  } else {
    weights_ = {4, 4, 1, 1, 1, 0.1};  // x, z, pitch, their velocities
    control_weight_ = 0.02;
    hover_ = {kQuadrotorMass * kGravity / 2, kQuadrotorMass * kGravity / 2};
  }
  stand_up();

  // Linearises one step of physics, as long as the feedback's period, around upright and at rest.
  model_->opt.timestep = seconds(spec.period);
  Matrix a(states, states);
  Matrix b(states, inputs);
  mjd_transitionFD(model_.get(), data_.get(), 1e-6, 1, a.values.data(), b.values.data(), nullptr, nullptr);
  const Matrix gain = lqr(a, b, weights_, std::vector<double>(inputs, control_weight_));
  for (std::size_t i = 0; i < inputs; ++i) {
    gain_.emplace_back(gain.values.begin() + static_cast<std::ptrdiff_t>(i * states),
                       gain.values.begin() + static_cast<std::ptrdiff_t>((i + 1) * states));
  }
  stand_up();
}

void Plant::stand_up() {
  mj_resetData(model_.get(), data_.get());
  std::copy(hover_.begin(), hover_.end(), data_->ctrl);
  mj_forward(model_.get(), data_.get());
}

Time Plant::push_time(std::uint64_t index) const {
  return static_cast<Time>(index) * kPushEvery + redag::Rng::stream(seed_, 1, index).uniform(0, kPushEvery - 1);
}

void Plant::push() {
  redag::Rng rng = redag::Rng::stream(seed_, 2, pushes_);
  data_->qvel[model_->nv - 1] += spec_.push * (2 * rng.uniform01() - 1);
}

void Plant::advance(Time now) {
  while (time_ < now) {
    const Time next_push = push_time(pushes_);
    const Time until = std::min(now, std::max(next_push, time_));
    while (time_ < until) {
      const Time goal = is_down() ? std::min(until, down_until_) : std::min(until, time_ + kStep);
      step(goal - time_);
    }
    if (time_ >= next_push && time_ <= now) {
      if (!is_down()) push();
      ++pushes_;
    }
  }
}

void Plant::step(Duration length) {
  cost_ += stage_cost() * seconds(length);
  if (is_down()) {
    time_ += length;
    if (!is_down()) stand_up();
    return;
  }
  model_->opt.timestep = seconds(length);
  mj_step(model_.get(), data_.get());
  time_ += length;
  if (!has_fallen()) return;
  ++falls_;
  down_until_ = time_ + kDown;
}

bool Plant::has_fallen() const {
  if (!std::isfinite(angle()) || std::abs(angle()) > kFallenAngle) return true;
  const double reach = spec_.kind == PlantSpec::Kind::CartPole ? kRail : kAirspace;
  return std::abs(position()) > reach || std::abs(height()) > reach;
}

double Plant::angle() const { return data_->qpos[model_->nq - 1]; }
double Plant::position() const { return data_->qpos[0]; }
double Plant::height() const { return spec_.kind == PlantSpec::Kind::CartPole ? 0 : data_->qpos[1]; }

State Plant::state() const {
  State state(data_->qpos, data_->qpos + model_->nq);
  state.insert(state.end(), data_->qvel, data_->qvel + model_->nv);
  return state;
}

std::vector<double> Plant::feedback(const State &state) const {
  std::vector<double> control = hover_;
  for (std::size_t i = 0; i < control.size(); ++i) {
    for (std::size_t j = 0; j < state.size(); ++j) control[i] -= gain_[i][j] * state[j];
  }
  return control;
}

void Plant::actuate(const std::vector<double> &control) {
  if (is_down()) return;
  for (std::size_t i = 0; i < control.size(); ++i) {
    const mjtNum *range = model_->actuator_ctrlrange + 2 * i;
    data_->ctrl[i] = std::clamp(control[i], range[0], range[1]);
  }
}

double Plant::stage_cost() const {
  double cost = 0;
  const State now = state();
  for (std::size_t i = 0; i < now.size(); ++i) cost += weights_[i] * now[i] * now[i];
  for (std::size_t i = 0; i < hover_.size(); ++i) {
    const double u = data_->ctrl[i] - hover_[i];
    cost += control_weight_ * u * u;
  }
  return cost;
}

double Plant::cost() const { return time_ > 0 ? cost_ / seconds(time_) : 0; }

}  // namespace closed_loop
