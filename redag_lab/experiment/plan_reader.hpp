// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Base of the readers of plans: values, lists, ranges and the options of random workloads. docs/experiments.md
// describes the text form. Not thread-safe.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include "redag/loader/validate.hpp"
#include "redag/loader/workload_yaml_tree.hpp"
#include "redag/loader/workload_yaml_values.hpp"
#include "redag_lab/experiment/grid.hpp"
#include "redag_lab/workload/generate.hpp"

namespace redag::experiment {

/// Each take() leaves its target unchanged if the key is missing or its value is a mistake, which it reports.
class PlanReader : protected yaml::ValueReader {
 protected:
  using Node = yaml::Node;

  PlanReader(const Node &root, std::string file) : ValueReader(std::move(file)), root_(root) {}

  template <class T, class Read>
  void take_with(const Node &map, const char *key, T &out, Read read) {
    const Node *node = yaml::find(map, key);
    if (node == nullptr) return;
    if (auto value = read(*node, key)) out = std::move(*value);
  }
  template <class T>
  void take(const Node &map, const char *key, T &out, std::uint32_t smallest = 1) {
    take_with(map, key, out, [&](const Node &node, std::string_view name) { return read<T>(node, name, smallest); });
  }
  template <class Enum, std::size_t N>
  void take(const Node &map, const char *key, Enum &out, const std::array<Enum, N> &values) {
    take_with(map, key, out, [&](const Node &node, std::string_view name) {
      return one_of(node, name, std::span<const Enum>(values));
    });
  }

  /// Takes one value or a list of values.
  template <class Value, class Read>
  void take_list(const char *key, std::vector<Value> &out, Read read) {
    const Node *node = yaml::find(root_, key);
    if (node == nullptr) return;
    out.clear();
    const std::vector<Node> one = {*node};
    for (const Node &item : node->kind == Node::Kind::Sequence ? node->children : one) {
      if (auto value = read(item, key)) out.push_back(std::move(*value));
    }
  }
  template <class T>
  void take_list(const char *key, std::vector<T> &out) {
    take_list(key, out, [this](const Node &node, std::string_view name) { return read<T>(node, name, 1); });
  }
  template <class Enum, std::size_t N>
  void take_list(const char *key, std::vector<Enum> &out, const std::array<Enum, N> &values) {
    take_list(key, out, [&](const Node &node, std::string_view name) {
      return one_of(node, name, std::span<const Enum>(values));
    });
  }
  /// Takes millionths: {from: 0.05, to: 1, step: 0.05}, a list, or a number.
  void take_range(const char *key, std::vector<std::uint32_t> &out);

  /// Returns the keys of take_generation(), and `more`.
  [[nodiscard]] static std::vector<std::string_view> generation_keys(std::vector<std::string_view> more = {});
  /// Takes the options of random workloads, except those that an experiment varies.
  void take_generation(const Node &map, lab::GenerateOptions &out);

  /// Reports a mistake at a key of the plan.
  void mistake(std::string_view key, std::string message, std::string hint = {});
  void check_name(std::string_view key, std::string_view name);
  /// Reports values that a factor has twice, and more combinations or units than can be run.
  void check_grid(const std::vector<Factor> &factors, std::uint32_t repetitions);

  const Node &root_;

 private:
  template <class T>
  std::optional<T> read(const Node &node, std::string_view name, std::uint32_t smallest) {
    if constexpr (std::is_same_v<T, std::string>) return text(node, name);
    if constexpr (std::is_same_v<T, double>) return real(node, name);
    if constexpr (std::is_same_v<T, Duration>) return duration(node, name);
    if constexpr (std::is_same_v<T, std::uint64_t>) return integer<std::uint64_t>(node, name, 0);
    if constexpr (std::is_same_v<T, std::uint32_t>) return integer<std::uint32_t>(node, name, smallest, kMaxBound);
  }
};

}  // namespace redag::experiment
