// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include <algorithm>

#include <fmt/format.h>

#include "redag/loader/workload_yaml_values.hpp"

namespace redag::yaml {
namespace {

using Kind = Callback::Kind;

std::optional<Kind> kind_of(std::string_view key) {
  for (const Named<Kind> &kind : kValues<Kind>) {
    if (kind.name == key) return kind.value;
  }
  return std::nullopt;
}

}  // namespace

std::optional<Callback> ValueReader::callback(const Node &node) {
  std::vector<std::string_view> keys = {"node"};
  for (const Named<Kind> &kind : kValues<Kind>) keys.emplace_back(kind.name);
  if (!check_map(node, "callback", keys)) return std::nullopt;
  Callback callback;
  const Node *kind_value = nullptr;
  bool sound = true;
  for (std::size_t i = 0; i + 1 < node.children.size(); i += 2) {
    const std::optional<Kind> kind = kind_of(node.children[i].text);
    if (!kind) continue;
    if (kind_value == nullptr) {
      callback.kind = *kind;
      kind_value = &node.children[i + 1];
    } else if (*kind != callback.kind) {
      error(node.children[i], fmt::format("callback has both {} and {}", to_string(callback.kind), to_string(*kind)),
            "use one task for each callback");
      sound = false;
    }
  }
  if (const Node *name = find(node, "node")) {
    const std::optional<std::string> value = text(*name, "node");
    sound = sound && value;
    callback.node = value.value_or("");
  } else {
    error(node, "callback has no node", "add 'node:', the full name as 'ros2 node list' prints it");
    sound = false;
  }
  if (kind_value == nullptr) {
    keys.erase(keys.begin());
    error(node, "callback does not say which callback of the node it is",
          fmt::format("add one of {}", fmt::join(keys, ", ")));
    return std::nullopt;
  }
  if (callback.kind == Kind::Timer || callback.kind == Kind::Waitable) {
    sound = counted_callback(*kind_value, callback) && sound;
  } else if (auto name = text(*kind_value, to_string(callback.kind))) {
    callback.name = std::move(*name);
  } else {
    sound = false;
  }
  return sound ? std::optional(std::move(callback)) : std::nullopt;
}

/// Reads a timer ("any", a period, {period, index}) or a waitable ("any", {index}). Returns false after a mistake.
bool ValueReader::counted_callback(const Node &node, Callback &callback) {
  const std::string_view kind = to_string(callback.kind);
  const bool is_timer = callback.kind == Kind::Timer;
  if (node.kind == Node::Kind::Scalar && node.text == "any") return true;
  if (node.kind == Node::Kind::Scalar && is_timer) {
    const std::optional<Duration> period = positive_duration(node, kind);
    callback.period = period.value_or(0);
    if (!period && diagnostics_.back().hint.empty()) diagnostics_.back().hint = "or 'any', or {index: 0}";
    return period.has_value();
  }
  if (node.kind != Node::Kind::Map) {
    wrong_type(node, kind, is_timer ? "a period, any, or a map of period, index" : "any, or a map of index");
    return false;
  }
  const std::size_t mistakes = diagnostics_.size();
  if (is_timer) {
    check_map(node, kind, {"period", "index"});
  } else {
    check_map(node, kind, {"index"});
  }
  const Node *period = is_timer ? find(node, "period") : nullptr;
  const Node *index = find(node, "index");
  if (period != nullptr) callback.period = positive_duration(*period, "period").value_or(0);
  if (index != nullptr) callback.index = integer<std::uint32_t>(*index, "index", 0);
  if (node.children.empty()) error(node, fmt::format("{} is empty", kind), "write 'any' to match any one of the node");
  return diagnostics_.size() == mistakes;
}

}  // namespace redag::yaml
