// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/robot/robot_yaml_reader.hpp"

#include <fmt/format.h>

#include "redag/base/cpu_list.hpp"

namespace redag::robot {
namespace {

using yaml::find;

}  // namespace

void ProcessorsReader::read_cpu_sets() {
  const Node *cpus_node = find(root_, "cpus");
  const Node *sets = find(root_, "cpu_sets");
  if ((cpus_node == nullptr) == (sets == nullptr)) {
    error(cpus_node == nullptr ? root_ : *cpus_node,
          cpus_node == nullptr ? "the robot names no processors" : "the robot has both 'cpus' and 'cpu_sets'",
          "add 'cpus: 0-3' if all processes share them, or else 'cpu_sets:'");
    is_broken_ = true;
    return;
  }
  if (cpus_node != nullptr) {
    CpuSet set;
    is_broken_ =
        !take(root_, "cpus", set.cpus, [this](const Node &node, auto key) { return cpus(node, key); }) || is_broken_;
    robot_.cpu_sets.push_back(std::move(set));
    return;
  }
  read_list(root_, "cpu_sets", names_of_sets_, [this](const Node &node) { read_cpu_set(node); });
  if (!robot_.cpu_sets.empty() || is_broken_) return;
  error(*sets, "cpu_sets is an empty list", "add a set such as {name: all, cpus: 0-3}");
  is_broken_ = true;
}

void ProcessorsReader::read_cpu_set(const Node &node) {
  CpuSet set;
  bool is_sound = check_map(node, "a CPU set", {"name", "cpus"}) &&
                  take_name(node, "a CPU set", names_of_sets_, robot_.cpu_sets.size(), set.name);
  if (is_sound && parse_cpu_list(set.name)) {
    error(*find(node, "name"), fmt::format("the name '{}' of a CPU set is also a list of processors", set.name),
          "choose a name such as 'control'");
    is_sound = false;
  }
  if (is_sound && find(node, "cpus") == nullptr) {
    error(node, fmt::format("CPU set '{}' has no processors", set.name), "add 'cpus:'");
    is_sound = false;
  }
  is_sound = is_sound && take(node, "cpus", set.cpus, [this](const Node &value, auto key) { return cpus(value, key); });
  for (const int cpu : set.cpus) {
    if (owned_.insert(cpu).second) continue;
    error(*find(node, "cpus"), fmt::format("processor {} of CPU set '{}' is also one of another set", cpu, set.name),
          "CPU sets share no processors");
    is_sound = false;
    break;
  }
  is_broken_ = is_broken_ || !is_sound;
  robot_.cpu_sets.push_back(std::move(set));
}

std::optional<std::size_t> ProcessorsReader::set_named(const Node &node) const {
  const auto found = names_of_sets_.find(node.text);
  return node.kind == Node::Kind::Scalar && found != names_of_sets_.end() ? std::optional(found->second) : std::nullopt;
}

std::string ProcessorsReader::names_of_sets() const {
  std::vector<std::string_view> names;
  for (const CpuSet &set : robot_.cpu_sets) names.emplace_back(set.name);
  return fmt::format("{}", fmt::join(names, ", "));
}

std::vector<int> ProcessorsReader::read_cpus(const Node &node) {
  if (const auto set = set_named(node)) return robot_.cpu_sets[*set].cpus;
  if (node.kind == Node::Kind::Scalar && !parse_cpu_list(node.text)) {
    if (is_broken_) return {};
    wrong_type(node, "cpus", "a CPU set or a list of processors such as 0-3");
    std::vector<std::string_view> names;
    for (const CpuSet &set : robot_.cpu_sets) names.emplace_back(set.name);
    diagnostics_.back().hint = did_you_mean(node.text, names, "");
    return {};
  }
  return cpus(node, "cpus").value_or(std::vector<int>{});
}

}  // namespace redag::robot
