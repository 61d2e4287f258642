// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/robot/robot_yaml.hpp"

#include <algorithm>
#include <array>
#include <iterator>
#include <utility>

#include "redag/model/validate.hpp"
#include "redag_lab/robot/robot_yaml_reader.hpp"

namespace redag::robot {
namespace {

using yaml::find;

constexpr std::array kPolicies = {PolicyKind::RateMonotonic, PolicyKind::DeadlineMonotonic, PolicyKind::Fixed};

class RobotReader : private ThreadsReader {
 public:
  RobotReader(const Node &root, const std::string &file, LoadOptions options) : ThreadsReader(root, file, options) {}

  Result<LoadedRobot> run() {
    if (check_map(root_, "a robot", {"robot", "policy", "cpus", "cpu_sets", "processes", "links", "threads", "irqs"})) {
      take(root_, "robot", robot_.name, [this](const Node &node, auto key) { return text(node, key); });
      if (const Node *policy = find(root_, "policy")) read_policy(*policy);
      read_cpu_sets();
      read_list(root_, "processes", names_of_processes_, [this](const Node &node) { read_process(node); });
      read_list(root_, "links", targets_, [this](const Node &node) { read_link(node); });
      read_list(root_, "threads", names_of_threads_, [this](const Node &node) { read_threads(node); });
      read_list(root_, "irqs", names_of_interrupts_, [this](const Node &node) { read_interrupts(node); });
      if (robot_.processes.empty() && !is_broken_) {
        error(root_, "the robot has no processes", "add one under 'processes:'");
      }
    }
    Diagnostics found = take_diagnostics();
    // Those of other files keep the order of these files.
    std::move(of_other_files_.begin(), of_other_files_.end(), std::back_inserter(found));
    if (has_errors(found)) return tl::unexpected<Diagnostics>(std::move(found));
    return LoadedRobot{std::move(robot_), std::move(found)};
  }

 private:
  void read_policy(const Node &node) {
    robot_.by_bounds = node.kind == Node::Kind::Scalar && node.text == kAudsley;
    if (robot_.by_bounds) {
      robot_.policy_place = place_of(node);
      options_.wcet_optional = false;  // there is no order without bounds
      return;
    }
    for (const PolicyKind policy : kPolicies) {
      if (node.kind != Node::Kind::Scalar || node.text != to_string(policy)) continue;
      robot_.policy = policy;
      return;
    }
    unknown_choice(node, "policy",
                   {to_string(kPolicies[0]), to_string(kPolicies[1]), to_string(kPolicies[2]), kAudsley});
  }
};

}  // namespace

bool is_robot(const yaml::Node &root) { return root.kind == yaml::Node::Kind::Map && find(root, "robot") != nullptr; }

Result<LoadedRobot> read_robot(const yaml::Node &root, const std::string &file, LoadOptions options) {
  return RobotReader(root, file, options).run();
}

}  // namespace redag::robot
