// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/robot/input.hpp"

#include <utility>

#include "redag/loader/workload_yaml_node.hpp"
#include "redag_lab/robot/union.hpp"

namespace redag::robot {
namespace {

Result<Input> robot_of(const yaml::Node &root, const std::string &file, LoadOptions options) {
  options.waits = false;  // a union has no devices
  Result<LoadedRobot> robot = read_robot(root, file, options);
  if (!robot) return tl::unexpected<Diagnostics>(std::move(robot.error()));
  Result<LoadedWorkload> united = union_of(robot->robot, options);
  Diagnostics &found = united ? united->warnings : united.error();
  found.insert(found.begin(), robot->warnings.begin(), robot->warnings.end());
  if (!united) return tl::unexpected<Diagnostics>(std::move(found));
  return Input{*std::move(united), std::move(robot->robot)};
}

}  // namespace

Result<Input> parse_input(std::string_view text, const std::string &file, LoadOptions options) {
  if (text.size() <= kMaxWorkloadBytes && text.find("robot") != std::string_view::npos) {
    const Result<yaml::Node> root = yaml::parse(text, file);
    if (root && is_robot(*root)) return robot_of(*root, file, options);
  }
  Result<LoadedWorkload> loaded = parse_workload(text, file, options);
  if (!loaded) return tl::unexpected<Diagnostics>(std::move(loaded.error()));
  return Input{*std::move(loaded), std::nullopt};
}

}  // namespace redag::robot
