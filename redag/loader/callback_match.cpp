// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/loader/callback_match.hpp"

#include <algorithm>
#include <array>

#include <fmt/format.h>

#include "redag/base/nearest.hpp"

namespace redag {
namespace {

using CallbackKind = Callback::Kind;

bool has_wildcard(std::string_view pattern) { return pattern.find_first_of("*?") != std::string_view::npos; }

/// Formats a callback; `name`, `period` and `index` only if they are given.
std::string describe(std::string_view node, CallbackKind kind, std::string_view name, Duration period,
                     std::optional<std::uint32_t> index) {
  std::string text = fmt::format("{} {}", node, to_string(kind));
  if (!name.empty()) text += fmt::format(" {}", name);
  if (period != 0) {
    const std::string duration = format_duration(period);
    const std::size_t unit = duration.find_first_not_of("-0123456789.");
    text += fmt::format(" {} {}", duration.substr(0, unit), duration.substr(unit));
  }
  if (index) text += fmt::format(" ({})", *index);
  return text;
}

bool is_counted(CallbackKind kind) { return kind == CallbackKind::Timer || kind == CallbackKind::Waitable; }

/// Formats the callback with only those parts that the pattern gives, so that only these are compared.
std::string in_words_of(const Callback &pattern, const CallbackId &id) {
  return describe(id.node, id.kind, id.name, pattern.period != 0 ? id.period : 0,
                  pattern.index ? std::optional(id.index) : std::nullopt);
}

}  // namespace

bool glob_match(std::string_view pattern, std::string_view text) {
  std::size_t p = 0;
  std::size_t t = 0;
  // The last "*" takes as little as possible, and one character more each time the rest does not fit. Earlier ones need
  // no second try.
  std::size_t after_star = std::string_view::npos;
  std::size_t taken_to = 0;
  while (t < text.size()) {
    if (p < pattern.size() && pattern[p] == '*') {
      after_star = ++p;
      taken_to = t;
    } else if (p < pattern.size() && (pattern[p] == '?' || pattern[p] == text[t])) {
      ++p;
      ++t;
    } else if (after_star != std::string_view::npos) {
      p = after_star;
      t = ++taken_to;
    } else {
      return false;
    }
  }
  return pattern.find_first_not_of('*', p) == std::string_view::npos;
}

std::string ros_name_mistake(std::string_view pattern) {
  constexpr std::string_view kLegal = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_/*?";
  if (pattern.empty()) return "is empty";
  const std::size_t odd = pattern.find_first_not_of(kLegal);
  if (odd != std::string_view::npos) {
    const auto byte = static_cast<unsigned char>(pattern[odd]);
    const bool printable = byte >= 0x20 && byte < 0x7f;
    return (printable ? fmt::format("contains '{}'", pattern[odd]) : fmt::format("contains byte {:#04x}", byte)) +
           ", which a ROS name cannot contain";
  }
  if (std::string_view("/*?").find(pattern.front()) == std::string_view::npos) return "does not begin with '/'";
  if (pattern.back() == '/') return "ends with '/'";
  if (pattern.find("//") != std::string_view::npos) return "contains '//'";
  return {};
}

bool matches(const Callback &pattern, const CallbackId &id) {
  return pattern.kind == id.kind && (pattern.period == 0 || pattern.period == id.period) &&
         (!pattern.index || *pattern.index == id.index) && glob_match(pattern.node, id.node) &&
         glob_match(pattern.name, id.name);
}

std::string to_string(const CallbackId &id) {
  return describe(id.node, id.kind, id.name, id.period, is_counted(id.kind) ? std::optional(id.index) : std::nullopt);
}

std::string to_string(const Callback &pattern) {
  return describe(pattern.node, pattern.kind, pattern.name, pattern.period, pattern.index);
}

bool is_ros_internal(const CallbackId &id) {
  constexpr std::array<std::string_view, 3> kTopics = {"/clock", "/parameter_events", "/rosout"};
  constexpr std::array<std::string_view, 17> kServices = {
      // Parameters, type descriptions and log levels: every node.
      "describe_parameters", "get_parameter_types", "get_parameters", "list_parameters", "set_parameters",
      "set_parameters_atomically", "get_type_description", "get_logger_levels", "set_logger_levels",
      // Managed nodes.
      "change_state", "get_available_states", "get_available_transitions", "get_state", "get_transition_graph",
      // Component containers.
      "_container/list_nodes", "_container/load_node", "_container/unload_node"};
  if (id.kind == CallbackKind::Subscription) return std::find(kTopics.begin(), kTopics.end(), id.name) != kTopics.end();
  if (id.kind == CallbackKind::Waitable) return !id.name.empty();
  if (id.kind != CallbackKind::Service) return false;
  // The service must be the node's own: an application may offer "/map/get_state" in a node of another name.
  const std::size_t length = id.node.size();
  if (id.name.size() <= length || id.name.compare(0, length, id.node) != 0 || id.name[length] != '/') return false;
  const std::string_view service = std::string_view(id.name).substr(length + 1);
  return std::find(kServices.begin(), kServices.end(), service) != kServices.end();
}

CallbackMatcher::CallbackMatcher(const Workload &workload) {
  for (const TaskRef &ref : flatten(workload)) {
    if (!ref.task->callback) continue;
    const auto entry = static_cast<std::uint32_t>(entries_.size());
    const std::string &node = ref.task->callback->node;
    if (has_wildcard(node)) {
      patterns_.push_back(entry);
    } else {
      by_node_[node].push_back(entry);
    }
    entries_.push_back(Entry{ref, workload.dags[ref.dag.value].name + "." + ref.task->name, false});
  }
}

std::optional<std::uint32_t> CallbackMatcher::entry_of(const CallbackId &id) const {
  const auto first_of = [&](const std::vector<std::uint32_t> &candidates) -> std::optional<std::uint32_t> {
    const auto found = std::find_if(candidates.begin(), candidates.end(), [&](std::uint32_t entry) {
      return matches(*entries_[entry].task.task->callback, id);
    });
    return found == candidates.end() ? std::nullopt : std::optional(*found);
  };
  if (const auto exact = by_node_.find(id.node); exact != by_node_.end()) {
    if (const auto entry = first_of(exact->second)) return entry;
  }
  return first_of(patterns_);
}

std::optional<TaskRef> CallbackMatcher::find(const CallbackId &id) {
  const std::optional<std::uint32_t> entry = entry_of(id);
  if (seen_texts_.insert(to_string(id)).second) seen_.push_back(Seen{id, entry});
  if (!entry) return std::nullopt;
  entries_[*entry].matched = true;
  return entries_[*entry].task;
}

std::string CallbackMatcher::explain(const Entry &entry) const {
  const Callback &pattern = *entry.task.task->callback;
  const std::string wanted = to_string(pattern);
  // A callback that fits may have gone to another task.
  for (const Seen &seen : seen_) {
    if (seen.entry && matches(pattern, seen.id)) {
      return fmt::format("{}: its callback, {}, belongs to {} already", entry.name, to_string(seen.id),
                         entries_[*seen.entry].name);
    }
  }
  std::vector<std::string> texts;
  texts.reserve(seen_.size());
  for (const Seen &seen : seen_) texts.push_back(in_words_of(pattern, seen.id));
  const std::string_view best = nearest(wanted, {texts.begin(), texts.end()});
  auto near = seen_.end();
  if (!best.empty()) {
    near = seen_.begin() + (std::find(texts.begin(), texts.end(), best) - texts.begin());
  } else {
    // No name is close. Looks for another period or topic of the same node, another namespace, or another kind.
    const auto same_node = [&](const Seen &seen) { return glob_match(pattern.node, seen.id.node); };
    const auto same_name = [&](const Seen &seen) {
      return !pattern.name.empty() && glob_match(pattern.name, seen.id.name);
    };
    const auto same_kind = [&](const Seen &seen) { return pattern.kind == seen.id.kind; };
    const auto search = [&](const auto &first, const auto &second) {
      if (near != seen_.end()) return;
      near = std::find_if(seen_.begin(), seen_.end(), [&](const Seen &seen) { return first(seen) && second(seen); });
    };
    search(same_node, same_name);
    search(same_node, same_kind);
    search(same_name, same_kind);
  }
  std::string line = fmt::format("{}: no callback matches {}", entry.name, wanted);
  if (near != seen_.end()) line += fmt::format("; nearest: {}", to_string(near->id));
  return line;
}

std::vector<std::string> CallbackMatcher::unmatched() const {
  std::vector<std::string> lines;
  for (const Entry &entry : entries_) {
    if (!entry.matched) lines.push_back(explain(entry));
  }
  return lines;
}

}  // namespace redag
