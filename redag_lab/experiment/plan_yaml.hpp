// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// What the readers and writers of plans share: lists of values, numbers, ranges, and how random workloads are drawn.
// The text forms are docs/experiments.md. Not thread-safe.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "redag/model/workload_yaml_tree.hpp"
#include "redag/model/workload_yaml_values.hpp"
#include "redag_lab/workload/generate.hpp"

namespace redag::experiment {

inline constexpr std::array kPolicies = {PolicyKind::RateMonotonic, PolicyKind::DeadlineMonotonic,
                                         PolicyKind::Fixed,         PolicyKind::Edf,
                                         PolicyKind::Fifo,          PolicyKind::ChainAware};

/// Each take... leaves its target as it is where the key is not given or its value is a mistake, which is reported.
class PlanReader : protected yaml::ValueReader {
 protected:
  using yaml::ValueReader::ValueReader;
  using Node = yaml::Node;

  template <class T, class Read>
  void take(const Node &map, const char *key, T &out, Read read) {
    const Node *node = yaml::find(map, key);
    if (node == nullptr) return;
    if (auto value = read(*node, key)) out = std::move(*value);
  }
  void take_text(const Node &map, const char *key, std::string &out);
  void take_number(const Node &map, const char *key, double &out);
  void take_flag(const Node &map, const char *key, bool &out);
  void take_duration(const Node &map, const char *key, Duration &out);
  void take_count(const Node &map, const char *key, std::uint32_t &out, std::uint32_t smallest);
  void take_seed(const Node &map, std::uint64_t &out);
  template <class Enum, std::size_t N>
  void take_enum(const Node &map, const char *key, Enum &out, const std::array<Enum, N> &values) {
    take(map, key, out,
         [&](const Node &node, std::string_view name) { return one_of(node, name, std::span<const Enum>(values)); });
  }

  /// One value, or a list of them.
  template <class Value, class Read>
  void take_list(const Node &map, const char *key, std::vector<Value> &out, Read read) {
    const Node *node = yaml::find(map, key);
    if (node == nullptr) return;
    out.clear();
    if (node->kind != Node::Kind::Sequence) {
      if (auto value = read(*node, key)) out.push_back(std::move(*value));
      return;
    }
    for (const Node &item : node->children) {
      if (auto value = read(item, key)) out.push_back(std::move(*value));
    }
  }
  void take_counts(const Node &map, const char *key, std::vector<std::uint32_t> &out);
  /// Millionths: {from: 0.05, to: 1, step: 0.05}, a list, or as on the command line (parse_range()).
  void take_range(const Node &map, const char *key, std::vector<std::uint32_t> &out);

  /// The frame of every plan: a map of `keys`, `experiment` being `kind`. Calls read(), and, where all can be read,
  /// find_mistakes(), whose mistakes are of keys.
  template <class Plan, class Read, class FindMistakes>
  Result<Plan> read_plan(const Node &root, std::string_view kind, const std::vector<std::string_view> &keys, Plan &plan,
                         Read read, FindMistakes find_mistakes) {
    if (is_plan(root, kind, keys)) {
      read();
      if (diagnostics_.empty()) {
        for (const auto &mistake : find_mistakes()) {
          const Node *node = yaml::find(root, mistake.key);
          error(node != nullptr ? *node : root, mistake.message, mistake.hint);
        }
      }
    }
    if (Diagnostics found = take_diagnostics(); !found.empty()) return tl::unexpected<Diagnostics>(std::move(found));
    return std::move(plan);
  }

  /// The keys of take_generation().
  [[nodiscard]] static const std::vector<std::string_view> &generation_keys();
  /// How random workloads are drawn, but for what an experiment varies.
  void take_generation(const Node &map, GenerateOptions &out);

 private:
  /// Can it be read? Whether it is of this kind is reported, but does not matter for that.
  bool is_plan(const Node &root, std::string_view kind, const std::vector<std::string_view> &keys);
  void take_tasks(const Node &map, GenerateOptions &out);
};

/// "0.05:1:0.05" (from:to:step) or "0.1,0.5" in millionths. Error: not of this form.
[[nodiscard]] Result<std::vector<std::uint32_t>> parse_range(std::string_view text);

/// What take_generation() reads, a line each.
[[nodiscard]] std::string generation_yaml(const GenerateOptions &options, std::string_view indentation);

/// "[1, 2]".
template <class Values, class Text>
[[nodiscard]] std::string yaml_list(const Values &values, Text text) {
  std::string joined;
  for (const auto &value : values) joined += (joined.empty() ? "" : ", ") + std::string(text(value));
  return "[" + joined + "]";
}

/// The name of an experiment has letters, digits, - and _: is it one?
[[nodiscard]] bool is_plan_name(std::string_view name);

}  // namespace redag::experiment
