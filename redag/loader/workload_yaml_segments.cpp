// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Reads the devices of a platform and the segments of a task.
#include <algorithm>
#include <array>

#include <fmt/format.h>

#include "redag/loader/validate.hpp"
#include "redag/loader/workload_yaml_values.hpp"

namespace redag::yaml {
namespace {

constexpr const char *kShape = "write [{cpu: 2ms}, {device: gpu, for: 8ms}, {cpu: 1ms}]; {wait: 5ms} needs no device";

}  // namespace

std::optional<std::vector<Device>> ValueReader::devices(const Node &node) {
  if (node.kind != Node::Kind::Map) {
    wrong_type(node, "devices", "a map of names, such as {gpu: {slots: 1}}");
    return std::nullopt;
  }
  std::vector<Device> devices;
  bool sound = true;
  for (std::size_t i = 0; i + 1 < node.children.size(); i += 2) {
    Device &device = devices.emplace_back();
    const Node &value = node.children[i + 1];
    const std::optional<std::string> name = text(node.children[i], "the name of a device");
    sound = sound && name;
    device.name = name.value_or("");
    if (value.kind == Node::Kind::Null) continue;
    if (!check_map(value, "a device", {"slots", "queue"})) {
      sound = false;
      continue;
    }
    if (const Node *slots = find(value, "slots")) {
      const auto count = integer<std::uint32_t>(*slots, "slots", 1, kMaxSlots);
      sound = sound && count;
      device.slots = count.value_or(1);
    }
    if (const Node *queue = find(value, "queue")) {
      const auto order = one_of<Device::Queue>(*queue, "queue");
      sound = sound && order;
      device.queue = order.value_or(Device::Queue::Priority);
    }
  }
  return sound ? std::optional(std::move(devices)) : std::nullopt;
}

std::optional<ValueReader::Segments> ValueReader::segments(const Node &node, const std::vector<Device> &devices) {
  if (node.kind != Node::Kind::Sequence) {
    wrong_type(node, "segments", "a list");
    return std::nullopt;
  }
  if (node.children.size() < 3) {
    error(node, "segments need a cpu segment, a wait, and a cpu segment",
          node.children.size() == 1 ? "without a wait, state 'wcet:'" : kShape);
    return std::nullopt;
  }
  Segments read;
  bool sound = true;
  for (std::size_t i = 0; i < node.children.size(); ++i) {
    const Node &item = node.children[i];
    if (!check_map(item, "a segment", {"cpu", "wait", "device", "for", "at_least"})) {
      sound = false;
      continue;
    }
    const bool is_cpu = find(item, "cpu") != nullptr;
    if (is_cpu != (i % 2 == 0)) {
      error(item, is_cpu ? "two cpu segments follow each other" : "a wait needs a cpu segment before it",
            is_cpu ? "make one of them" : "a job asks for what it waits for: add a {cpu: ...} before the wait");
      return std::nullopt;
    }
    if (is_cpu) {
      const std::optional<Duration> length = cpu_segment(item);
      sound = sound && length;
      read.wcet = std::min(kMaxDuration + 1, read.wcet + length.value_or(0));
    } else {
      const std::optional<Wait> wait = wait_segment(item, devices);
      sound = sound && wait;
      read.waits.push_back(wait.value_or(Wait{}));
      read.waits.back().after = read.wcet;
    }
  }
  if (node.children.size() % 2 == 0) {
    error(node.children.back(), "the last segment is a wait", "a job ends on a worker: add a {cpu: ...} after it");
    sound = false;
  }
  return sound ? std::optional(std::move(read)) : std::nullopt;
}

std::optional<Duration> ValueReader::cpu_segment(const Node &node) {
  bool sound = true;
  for (const char *other : {"wait", "device", "for", "at_least"}) {
    const Node *found = find(node, other);
    if (found == nullptr) continue;
    error(*found, fmt::format("a cpu segment has '{}'", other), "give each wait a segment of its own");
    sound = false;
  }
  const std::optional<Duration> length = positive_duration(*find(node, "cpu"), "cpu");
  return sound ? length : std::nullopt;
}

std::optional<Wait> ValueReader::wait_segment(const Node &node, const std::vector<Device> &devices) {
  const Node *device = find(node, "device");
  const Node *wait = find(node, "wait");
  const Node *length = device != nullptr ? find(node, "for") : wait;
  if ((device != nullptr) == (wait != nullptr)) {
    error(node, device == nullptr ? "a segment needs one of cpu, wait, device" : "a segment has both device and wait",
          kShape);
    return std::nullopt;
  }
  if (length == nullptr) {
    error(node, "a segment on a device does not say how long it takes", "add 'for:', its longest time of service");
    return std::nullopt;
  }
  if (const Node *extra = find(node, "for"); extra != nullptr && wait != nullptr) {
    error(*extra, "a wait without a device has 'for'", "write {wait: 5ms}");
    return std::nullopt;
  }
  Wait read;
  bool sound = true;
  const std::optional<Duration> longest = positive_duration(*length, device != nullptr ? "for" : "wait");
  sound = sound && longest;
  read.longest = longest.value_or(1);
  if (const Node *least = find(node, "at_least")) {
    const std::optional<Duration> shortest = positive_duration(*least, "at_least");
    sound = sound && shortest;
    read.shortest = shortest.value_or(0);
  }
  if (device == nullptr) return sound ? std::optional(read) : std::nullopt;
  const std::optional<std::string> name = text(*device, "device");
  if (!name) return std::nullopt;
  const auto found = std::find_if(devices.begin(), devices.end(), [&](const Device &one) { return one.name == *name; });
  if (found == devices.end()) {
    std::vector<std::string_view> names;
    names.reserve(devices.size());
    for (const Device &one : devices) names.emplace_back(one.name);
    error(*device, fmt::format("there is no device {}", describe(*device)),
          did_you_mean(*name, names, "add it to the platform: 'devices: {name: {slots: 1}}'"));
    return std::nullopt;
  }
  read.device = DeviceId(static_cast<std::size_t>(found - devices.begin()));
  return sound ? std::optional(read) : std::nullopt;
}

}  // namespace redag::yaml
