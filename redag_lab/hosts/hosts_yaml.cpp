// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/hosts/hosts_yaml.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <utility>

#include "redag/base/text.hpp"
#include "redag/model/validate.hpp"
#include "redag/model/workload_yaml_values.hpp"

namespace redag::hosts {
namespace {

using yaml::find;
using yaml::Node;

class HostsReader : private yaml::ValueReader {
 public:
  HostsReader(const Node &root, const std::string &file) : ValueReader(file), root_(root) {}

  Result<HostList> run() {
    if (check_map(root_, "a file of hosts", {"hosts", "links"})) {
      for_each("hosts", [this](const Node &node) { read_host(node); });
      for_each("links", [this](const Node &node) { read_link(node); });
      if (find(root_, "hosts") == nullptr) error(root_, "the file lists no hosts", "add them under 'hosts:'");
    }
    Diagnostics found = take_diagnostics();
    if (!found.empty()) return tl::unexpected<Diagnostics>(std::move(found));
    return std::move(list_);
  }

 private:
  template <class Read>
  void for_each(std::string_view key, Read read) {
    const Node *node = find(root_, key);
    if (node == nullptr) return;
    if (node->kind != Node::Kind::Sequence) return wrong_type(*node, key, "a list");
    for (const Node &item : node->children) read(item);
  }

  void read_host(const Node &node) {
    HostEntry host;
    host.file = file_;
    host.line = node.line;
    host.column = node.column;
    if (!check_map(node, "a host", {"name", "result", "offset", "rate", "clock", "uncertainty"})) return;
    for (const char *key : {"name", "result"}) {
      if (find(node, key) != nullptr) continue;
      return error(node, fmt::format("a host has no {}", key), fmt::format("add '{}:'", key));
    }
    if (const auto name = text(*find(node, "name"), "name")) {
      host.name = *name;
      if (const std::string why = host_name_mistake(host.name); !why.empty()) {
        error(*find(node, "name"), fmt::format("the name {} of a host {}", in_quotes(host.name), why));
      }
    }
    if (const auto result = text(*find(node, "result"), "result")) host.result = relative(*result);
    read_texts(node, "offset", [&](const Node &at, const std::string &offset) {
      if (const auto reading = value_of(at, parse_offset(offset))) host.clock.readings.push_back(*reading);
      host.clock.by += (host.clock.by.empty() ? "" : ", ") + offset;
    });
    read_texts(node, "clock",
               [&](const Node &, const std::string &path) { host.clock_files.push_back(relative(path)); });
    if (const Node *rate = find(node, "rate")) {
      if (const auto given = text(*rate, "rate")) host.clock.rate = value_of(*rate, parse_rate(*given));
    }
    if (const Node *extra = find(node, "uncertainty")) {
      host.clock.extra = duration_from_zero(*extra, "uncertainty").value_or(0);
      if (host.clock.extra > kMostOffset) error(*extra, "the uncertainty is more than a day");
    }
    list_.hosts.push_back(std::move(host));
  }

  void read_link(const Node &node) {
    Link link{.file = file_, .line = node.line, .column = node.column};
    if (!check_map(node, "a link", {"from", "to", "transport"})) return;
    for (const char *key : {"from", "to", "transport"}) {
      if (find(node, key) != nullptr) continue;
      return error(node, fmt::format("the link has no '{}'", key),
                   "write {from: HOST.DAG.TASK, to: HOST.DAG.TASK, transport: TIME}");
    }
    link.from = text(*find(node, "from"), "from").value_or("");
    link.to = text(*find(node, "to"), "to").value_or("");
    link.transport = duration_from_zero(*find(node, "transport"), "transport").value_or(0);
    list_.links.push_back(std::move(link));
  }

  // Reads a text, or a list of texts.
  template <class Take>
  void read_texts(const Node &map, std::string_view key, Take take) {
    const Node *node = find(map, key);
    if (node == nullptr) return;
    if (node->kind != Node::Kind::Sequence) {
      if (const auto one = text(*node, key)) take(*node, *one);
      return;
    }
    for (const Node &item : node->children) {
      if (const auto one = text(item, key)) take(item, *one);
    }
  }

  template <class Value>
  std::optional<Value> value_of(const Node &at, const Result<Value> &parsed) {
    if (parsed) return *parsed;
    for (const Diagnostic &each : parsed.error()) error(at, each.message, each.hint);
    return std::nullopt;
  }

  [[nodiscard]] std::string relative(const std::string &path) const {
    return (std::filesystem::path(file_).parent_path() / path).string();
  }

  const Node &root_;
  HostList list_;
};

}  // namespace

std::string host_name_mistake(std::string_view name) {
  if (std::string why = name_mistake(name); !why.empty()) return why;
  const std::size_t at = name.find_first_of("./,= ");
  return at == std::string_view::npos ? std::string()
                                      : fmt::format("contains '{}', which separates names", name.substr(at, 1));
}

Result<HostList> parse_hosts(std::string_view text, const std::string &file) {
  const Result<Node> root = yaml::parse(text, file);
  if (!root) return tl::unexpected<Diagnostics>(root.error());
  return HostsReader(*root, file).run();
}

}  // namespace redag::hosts
