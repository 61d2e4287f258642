// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include <algorithm>
#include <limits>

#include <fmt/format.h>

#include "redag/loader/workload_yaml_values.hpp"

namespace redag::yaml {

std::optional<Callback> ValueReader::callback(const Node &node) {
  using Kind = Callback::Kind;
  std::vector<std::string_view> kinds;
  for (const Named<Kind> &kind : kValues<Kind>) kinds.emplace_back(kind.name);
  std::vector<std::string_view> keys = kinds;
  keys.insert(keys.begin(), "node");
  if (!check_map(node, "callback", keys)) return std::nullopt;
  const std::size_t mistakes = diagnostics_.size();
  Callback callback;
  const Node *value = nullptr;
  for (std::size_t i = 0; i + 1 < node.children.size(); i += 2) {
    const std::string &key = node.children[i].text;
    const auto kind = std::find(kinds.begin(), kinds.end(), key);
    if (kind == kinds.end()) continue;
    if (value == nullptr) {
      callback.kind = kValues<Kind>[static_cast<std::size_t>(kind - kinds.begin())].value;
      value = &node.children[i + 1];
    } else if (key != to_string(callback.kind)) {
      error(node.children[i], fmt::format("callback has both {} and {}", to_string(callback.kind), key),
            "use one task for each callback");
    }
  }
  take(node, "node", callback.node);
  if (find(node, "node") == nullptr) {
    error(node, "callback has no node", "add 'node:', the full name as 'ros2 node list' prints it");
  }
  if (value == nullptr) {
    return error(node, "callback does not say which callback of the node it is",
                 fmt::format("add one of {}", fmt::join(kinds, ", ")));
  }
  if (callback.kind == Kind::Timer || callback.kind == Kind::Waitable) {
    take_counted(*value, callback);
  } else {
    take(node, to_string(callback.kind), callback.name);
  }
  if (diagnostics_.size() > mistakes) return std::nullopt;
  return callback;
}

/// Reads a timer ("any", a period, {period, index}) or a waitable ("any", {index}).
void ValueReader::take_counted(const Node &node, Callback &callback) {
  const std::string_view kind = to_string(callback.kind);
  const bool is_timer = callback.kind == Callback::Kind::Timer;
  if (node.is("any")) return;
  if (node.kind == Node::Kind::Scalar && is_timer) {
    const std::optional<Duration> period = positive_duration(node, kind);
    callback.period = period.value_or(0);
    if (!period && diagnostics_.back().hint.empty()) diagnostics_.back().hint = "or 'any', or {index: 0}";
  } else if (node.kind != Node::Kind::Map) {
    wrong_type(node, kind, is_timer ? "a period, any, or a map of period, index" : "any, or a map of index");
  } else {
    std::vector<std::string_view> keys = {"index"};
    if (is_timer) keys.insert(keys.begin(), "period");
    check_map(node, kind, keys);
    if (is_timer) take(node, "period", callback.period);
    take(node, "index", callback.index, 0, std::numeric_limits<std::uint32_t>::max());
    if (node.children.empty())
      error(node, fmt::format("{} is empty", kind), "write 'any' to match any one of the node");
  }
}

}  // namespace redag::yaml
