// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Shared by the readers and writers of plans: lists of values, numbers, ranges, and the options of random workloads.
// docs/experiments.md describes the text forms. Not thread-safe.
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

/// Each take...() leaves its target unchanged if the key is missing or its value is a mistake, which it reports.
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

  /// Takes one value or a list of values.
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
  /// Takes millionths: {from: 0.05, to: 1, step: 0.05}, a list, or the form of the command line (parse_range()).
  void take_range(const Node &map, const char *key, std::vector<std::uint32_t> &out);

  /// Checks the parts common to all plans: a map of `keys` whose `experiment` is `kind`. Calls read() and, if it
  /// reported nothing, find_mistakes(), and places each mistake at its key.
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

  /// Returns the keys of take_generation().
  [[nodiscard]] static const std::vector<std::string_view> &generation_keys();
  /// Takes the options of random workloads, except those that an experiment varies.
  void take_generation(const Node &map, lab::GenerateOptions &out);

 private:
  /// True if the root can be read as a plan. A wrong kind is reported, but does not prevent reading.
  bool is_plan(const Node &root, std::string_view kind, const std::vector<std::string_view> &keys);
  void take_tasks(const Node &map, lab::GenerateOptions &out);
};

/// Parses "0.05:1:0.05" (from:to:step) or "0.1,0.5" into millionths. Error: another form.
[[nodiscard]] Result<std::vector<std::uint32_t>> parse_range(std::string_view text);

/// Writes the keys of take_generation(), one per line.
[[nodiscard]] std::string generation_yaml(const lab::GenerateOptions &options, std::string_view indentation);

/// Returns the list as "[1, 2]".
template <class Values, class Text>
[[nodiscard]] std::string yaml_list(const Values &values, Text text) {
  std::string joined;
  for (const auto &value : values) joined += (joined.empty() ? "" : ", ") + std::string(text(value));
  return "[" + joined + "]";
}

/// True if `name` consists of letters, digits, - and _, as the name of an experiment must.
[[nodiscard]] bool is_plan_name(std::string_view name);

}  // namespace redag::experiment
