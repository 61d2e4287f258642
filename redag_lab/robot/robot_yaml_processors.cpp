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
  if (const Node *hosts = find(root_, "hosts")) {
    for (const char *key : {"cpus", "cpu_sets"}) {
      if (const Node *node = find(root_, key)) {
        error(*node, fmt::format("the robot has both 'hosts' and '{}'", key), "give the processors to the hosts");
        is_broken_ = true;
      }
    }
    read_list(root_, "hosts", names_of_hosts_, [this](const Node &node) { read_host(node); });
    if (robot_.hosts.empty() && !is_broken_) error(*hosts, "hosts is an empty list", "add {name: NAME, cpus: 0-3}");
  } else {
    read_processors(root_, "the robot", CpuSet());
  }
  is_broken_ = is_broken_ || robot_.cpu_sets.empty();
}

void ProcessorsReader::read_host(const Node &node) {
  CpuSet set;
  owned_.clear();
  set.host = robot_.hosts.size();
  if (!check_map(node, "a host", {"name", "cpus", "cpu_sets"}) ||
      !take_name(node, "a host", names_of_hosts_, set.host, set.name)) {
    is_broken_ = true;
    return;
  }
  robot_.hosts.push_back(set.name);
  host_ = set.host;
  const std::string what = fmt::format("host '{}'", set.name);
  read_processors(node, what, std::move(set));
}

void ProcessorsReader::read_processors(const Node &map, const std::string &what, CpuSet set) {
  const Node *cpus_node = find(map, "cpus");
  const Node *sets = find(map, "cpu_sets");
  if ((cpus_node == nullptr) == (sets == nullptr)) {
    error(cpus_node == nullptr ? map : *cpus_node,
          what + (cpus_node == nullptr ? " names no processors" : " has both 'cpus' and 'cpu_sets'"),
          "add 'cpus: 0-3' if all processes share them, or else 'cpu_sets:'");
    is_broken_ = true;
    return;
  }
  if (cpus_node != nullptr) {
    const bool is_sound = (set.name.empty() || is_new_set(*find(map, "name"), set.name)) &&
                          take(map, "cpus", set.cpus, [this](const Node &node, auto key) { return cpus(node, key); });
    is_broken_ = is_broken_ || !is_sound;
    robot_.cpu_sets.push_back(std::move(set));
    return;
  }
  const std::size_t before = robot_.cpu_sets.size();
  read_list(map, "cpu_sets", names_of_sets_, [this](const Node &node) { read_cpu_set(node); });
  if (robot_.cpu_sets.size() > before || is_broken_) return;
  error(*sets, "cpu_sets is an empty list", "add a set such as {name: all, cpus: 0-3}");
  is_broken_ = true;
}

bool ProcessorsReader::is_new_set(const Node &at, const std::string &name) {
  if (parse_cpu_list(name)) {
    error(at, fmt::format("the name '{}' of a host is also a list of processors", name),
          "choose a name such as 'vision'");
    return false;
  }
  if (names_of_sets_.emplace(name, robot_.cpu_sets.size()).second) return true;
  error(at, fmt::format("a CPU set of another host is called '{}' as well", name), "choose a unique name");
  return false;
}

void ProcessorsReader::read_cpu_set(const Node &node) {
  CpuSet set;
  set.host = host_;
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

std::vector<int> ProcessorsReader::read_cpus(const Node &node, std::size_t host) {
  if (const auto set = set_named(node)) {
    const CpuSet &found = robot_.cpu_sets[*set];
    if (found.host == host) return found.cpus;
    error(node,
          fmt::format("CPU set '{}' is on host '{}', and these are on host '{}'", found.name, robot_.hosts[found.host],
                      robot_.hosts[host]),
          "choose a CPU set of the same host");
    return {};
  }
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

std::size_t ProcessorsReader::read_host_of(const Node &node, const std::string &what,
                                           std::optional<std::size_t> known) {
  const Node *host = find(node, "host");
  if (host == nullptr) {
    if (!known && !robot_.hosts.empty() && !is_broken_) {
      error(node, fmt::format("nothing says on which host {} are", what),
            fmt::format("add 'host:' with one of {}", fmt::join(robot_.hosts, ", ")));
    }
    return known.value_or(0);
  }
  const auto found = names_of_hosts_.find(host->text);
  if (host->kind != Node::Kind::Scalar || found == names_of_hosts_.end()) {
    if (is_broken_) return 0;
    const std::vector<std::string_view> names(robot_.hosts.begin(), robot_.hosts.end());
    error(*host, fmt::format("there is no host {}", describe(*host)),
          names.empty() ? "remove 'host:': the robot has no 'hosts:'"
                        : did_you_mean(host->text, names, "add it to 'hosts:'"));
    return known.value_or(0);
  }
  if (known && *known != found->second) {
    error(*host, fmt::format("{} are on host '{}' by their process or task", what, robot_.hosts[*known]),
          "remove 'host:'");
  }
  return found->second;
}

}  // namespace redag::robot
