// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Reads the devices of a platform and the segments of a task.
#include <algorithm>

#include <fmt/format.h>

#include "redag/loader/workload_yaml_values.hpp"

namespace redag::yaml {
namespace {

constexpr const char *kShape = "write [{cpu: 2ms}, {device: gpu, for: 8ms}, {cpu: 1ms}]; {wait: 5ms} needs no device";

}  // namespace

std::optional<std::vector<Device>> ValueReader::devices(const Node &node) {
  if (node.kind != Node::Kind::Map) return wrong_type(node, "devices", "a map of names, such as {gpu: {slots: 1}}");
  const std::size_t mistakes = diagnostics_.size();
  std::vector<Device> devices;
  for (std::size_t i = 0; i + 1 < node.children.size(); i += 2) {
    Device &device = devices.emplace_back();
    const Node &value = node.children[i + 1];
    device.name = text(node.children[i], "the name of a device").value_or("");
    if (value.kind == Node::Kind::Null) continue;
    if (check_map(value, "a device", fields::keys_of<fields::kDevice>())) take_fields(value, device, fields::kDevice);
  }
  if (diagnostics_.size() > mistakes) return std::nullopt;
  return devices;
}

std::optional<ValueReader::Segments> ValueReader::segments(const Node &node, const std::vector<Device> &devices) {
  if (node.kind != Node::Kind::Sequence) return wrong_type(node, "segments", "a list");
  if (node.children.size() < 3) {
    return error(node, "segments need a cpu segment, a wait, and a cpu segment",
                 node.children.size() == 1 ? "without a wait, state 'wcet:'" : kShape);
  }
  const std::size_t mistakes = diagnostics_.size();
  Segments read;
  for (std::size_t i = 0; i < node.children.size(); ++i) {
    const Node &item = node.children[i];
    if (!check_map(item, "a segment", {"cpu", "wait", "device", "for", "at_least"})) continue;
    const bool is_cpu = find(item, "cpu") != nullptr;
    if (is_cpu != (i % 2 == 0)) {
      return error(item, is_cpu ? "two cpu segments follow each other" : "a wait needs a cpu segment before it",
                   is_cpu ? "make one of them" : "a job asks for what it waits for: add a {cpu: ...} before the wait");
    }
    if (is_cpu) {
      read.wcet = std::min(kMaxDuration + 1, read.wcet + cpu_segment(item));
    } else {
      read.waits.push_back(wait_segment(item, devices).value_or(Wait{}));
      read.waits.back().after = read.wcet;
    }
  }
  if (node.children.size() % 2 == 0) {
    error(node.children.back(), "the last segment is a wait", "a job ends on a worker: add a {cpu: ...} after it");
  }
  if (diagnostics_.size() > mistakes) return std::nullopt;
  return read;
}

Duration ValueReader::cpu_segment(const Node &node) {
  for (const char *other : {"wait", "device", "for", "at_least"}) {
    const Node *found = find(node, other);
    if (found == nullptr) continue;
    error(*found, fmt::format("a cpu segment has '{}'", other), "give each wait a segment of its own");
  }
  return positive_duration(*find(node, "cpu"), "cpu").value_or(0);
}

std::optional<Wait> ValueReader::wait_segment(const Node &node, const std::vector<Device> &devices) {
  const Node *device = find(node, "device");
  const Node *service = find(node, "for");
  const bool is_wait = find(node, "wait") != nullptr;
  if (device == nullptr && !is_wait) return error(node, "a segment needs one of cpu, wait, device", kShape);
  if (device != nullptr && is_wait) return error(node, "a segment has both device and wait", kShape);
  if (is_wait && service != nullptr) return error(*service, "a wait without a device has 'for'", "write {wait: 5ms}");
  if (!is_wait && service == nullptr) {
    return error(node, "a segment on a device does not say how long it takes",
                 "add 'for:', its longest time of service");
  }
  Wait read;
  take(node, is_wait ? "wait" : "for", read.longest);
  take(node, "at_least", read.shortest);
  const std::optional<std::string> name = is_wait ? std::nullopt : text(*device, "device");
  if (!name) return read;
  std::vector<std::string_view> names;
  for (const Device &one : devices) names.emplace_back(one.name);
  const auto found = std::find(names.begin(), names.end(), *name);
  if (found == names.end()) {
    return error(*device, fmt::format("there is no device {}", describe(*device)),
                 did_you_mean(*name, names, "add it to the platform: 'devices: {name: {slots: 1}}'"));
  }
  read.device = DeviceId(static_cast<std::size_t>(found - names.begin()));
  return read;
}

}  // namespace redag::yaml
