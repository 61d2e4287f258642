// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Reads values of a YAML tree (durations, numbers, names, choices) for the readers of YAML files, and collects the
// mistakes. Knows types, not rules: validate.hpp holds the rules of workloads. Not thread-safe.
#pragma once

#include <charconv>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include "redag/base/result.hpp"
#include "redag/base/time.hpp"
#include "redag/loader/fields.hpp"
#include "redag/loader/workload_yaml_tree.hpp"
#include "redag/model/workload.hpp"

namespace redag::yaml {

/// Returns the value of `key`, the first one if there are two; null if there is none, or no map.
[[nodiscard]] const Node *find(const Node &map, std::string_view key);

/// Base of the readers. Each reading function returns an empty value after it has reported a mistake, and therefore the
/// functions that report one return this empty value. `key` names the value in messages.
class ValueReader {
 public:
  explicit ValueReader(std::string file) : file_(std::move(file)) {}

 protected:
  std::nullopt_t error(const Node &at, std::string message, std::string hint = {});
  std::nullopt_t wrong_type(const Node &at, std::string_view key, std::string_view expected);
  /// The same for a number, which a quoted text may have been meant to be.
  std::nullopt_t wrong_number(const Node &at, std::string_view key, std::string_view expected);

  /// Returns "did you mean 'x'?", or `else_say` if no candidate is near.
  std::string did_you_mean(std::string_view name, const std::vector<std::string_view> &candidates,
                           std::string_view else_say);

  /// Returns false if the node is not a map. Reports unknown, repeated and odd keys.
  bool check_map(const Node &node, std::string_view what, const std::vector<std::string_view> &keys);

  /// Returns the mistakes in the order of the file. If there are very many, only the first ones and the number of the
  /// others.
  [[nodiscard]] Diagnostics take_diagnostics();

  /// Reads a value by its type. Numbers are from `least` to `most`; a duration is above 0 if `least` is.
  template <class T>
  std::optional<T> value(const Node &node, std::string_view key, std::int64_t least = 1,
                         [[maybe_unused]] std::int64_t most = kMaxDuration) {
    if constexpr (std::is_same_v<T, Duration>)
      return least > 0 ? positive_duration(node, key) : duration(node, key);
    else if constexpr (std::is_integral_v<T>)
      return integer(node, key, static_cast<T>(least), static_cast<T>(most));
    else if constexpr (std::is_enum_v<T>)
      return one_of<T>(node, key);
    else if constexpr (std::is_same_v<T, std::string>)
      return text(node, key);
    else if constexpr (std::is_same_v<T, std::vector<int>>)
      return cpus(node, key);
    else if constexpr (std::is_same_v<T, std::vector<Device>>)
      return devices(node);
    else if constexpr (std::is_same_v<T, ExecutionTime>)
      return execution(node);
    else if constexpr (std::is_same_v<T, Degrade>)
      return degrade(node);
    else if constexpr (std::is_same_v<T, Callback>)
      return callback(node);
  }
  /// Reads the value of `key` into `out` if it is there. Returns false after a mistake.
  template <class T>
  bool take(const Node &map, std::string_view key, T &out, std::int64_t least = 1, std::int64_t most = kMaxDuration) {
    const Node *node = find(map, key);
    if (node == nullptr) return true;
    auto read = value<typename fields::ValueOf<T>::type>(*node, key, least, most);
    if (!read) return false;
    out = *std::move(read);
    return true;
  }
  /// Reads the fields of `map` that are not joint into `owner`. Returns those whose values are mistakes.
  template <class Owner, class Rows>
  FieldSet take_fields(const Node &map, Owner &owner, const Rows &rows) {
    FieldSet broken;
    fields::for_each(rows, [&](const auto &row) {
      if constexpr (fields::kHasMember<decltype(row.member)>) {
        const fields::Rule &rule = row.rule;
        if (!rule.is_joint && !take(map, row.key, owner.*row.member, rule.least, rule.most)) broken |= row.field;
      }
    });
    return broken;
  }

  std::optional<Duration> duration(const Node &node, std::string_view key);
  std::optional<Duration> positive_duration(const Node &node, std::string_view key);
  /// Reads a rate as its period.
  std::optional<Duration> rate(const Node &node, std::string_view key);
  std::optional<Duration> duration_from_zero(const Node &node, std::string_view key);
  /// Reads a name; see name_mistake().
  std::optional<std::string> text(const Node &node, std::string_view key);
  /// Reads processors, ascending: a text for parse_cpu_list(), or a list of such texts.
  std::optional<std::vector<int>> cpus(const Node &node, std::string_view key);
  std::optional<ExecutionTime> execution(const Node &node);
  std::optional<Degrade> degrade(const Node &node);
  std::optional<Callback> callback(const Node &node);

  /// What `segments:` of a task says.
  struct Segments {
    Duration wcet = 0;  // the sum of the cpu segments; above kMaxDuration if it is too large
    std::vector<Wait> waits;
  };
  /// Reads a cpu segment, then waits and cpu segments in turn. `devices` are those of the platform.
  std::optional<Segments> segments(const Node &node, const std::vector<Device> &devices);
  std::optional<std::vector<Device>> devices(const Node &node);

  template <class Integer>
  std::optional<Integer> integer(const Node &node, std::string_view key, Integer smallest,
                                 Integer largest = std::numeric_limits<Integer>::max()) {
    Integer value = 0;
    if (node.kind == Node::Kind::Scalar && !node.quoted) {
      const char *end = node.text.data() + node.text.size();
      const auto [used, code] = std::from_chars(node.text.data(), end, value);
      if (code == std::errc() && used == end && value >= smallest && value <= largest) return value;
    }
    return wrong_number(node, key,
                        "a whole number from " + std::to_string(smallest) + " to " + std::to_string(largest));
  }

  std::optional<double> real(const Node &node, std::string_view key);

  template <class Enum>
  std::optional<Enum> one_of(const Node &node, std::string_view key) {
    std::vector<Enum> values;
    values.reserve(std::size(kValues<Enum>));
    for (const Named<Enum> &named : kValues<Enum>) values.push_back(named.value);
    return one_of(node, key, std::span<const Enum>(values));
  }
  /// Reads a choice of these, as to_string() writes it.
  template <class Enum>
  std::optional<Enum> one_of(const Node &node, std::string_view key, std::span<const Enum> values) {
    std::vector<std::string_view> names;
    for (const Enum value : values) {
      names.emplace_back(to_string(value));
      if (node.kind == Node::Kind::Scalar && node.text == names.back()) return value;
    }
    return unknown_choice(node, key, names);
  }
  std::nullopt_t unknown_choice(const Node &node, std::string_view key, const std::vector<std::string_view> &names);

  std::string file_;
  Diagnostics diagnostics_;

 private:
  std::optional<ExecutionTime> normal_execution(const Node &node);
  std::optional<ExecutionTime> empirical_execution(const Node &node);
  void take_counted(const Node &node, Callback &callback);
  Duration cpu_segment(const Node &node);
  std::optional<Wait> wait_segment(const Node &node, const std::vector<Device> &devices);

  // Many wrong names among many candidates would take quadratic time. After this many comparisons there are no more
  // hints.
  std::size_t comparisons_left_ = 200'000;
};

}  // namespace redag::yaml
