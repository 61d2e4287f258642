// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Events of nodes for the tests of this folder, and what is made of them.
#pragma once

#include <gtest/gtest.h>

#include <cstdint>
#include <map>
#include <string>
#include <string_view>
#include <utility>

#include "redag/loader/workload_yaml.hpp"
#include "redag_lab/import/model.hpp"

namespace redag::lab {

inline constexpr Time kMs = kMillisecond;

// Writes the events of one process as rclcpp records them. Handles are numbers that it gives out.
class RecordedNodes {
 public:
  using Kind = RosEvent::Kind;
  using Handle = std::uint64_t;

  explicit RecordedNodes(Recording &recording, std::uint32_t process = 1) : recording_(recording), process_(process) {}

  Time now = 0;

  Handle node(const std::string &name) {
    const Handle handle = next_++;
    add(Kind::NodeInit, handle, 0, 0, name, "/");
    return handle;
  }
  Handle publisher(Handle node, const std::string &topic) {
    const Handle handle = next_++;
    add(Kind::PublisherInit, handle, node, 0, topic);
    return handle;
  }
  /// Returns the callback, as the functions below do.
  Handle subscription(Handle node, const std::string &topic) {
    const Handle handle = next_;
    next_ += 4;
    RosEvent event = made(Kind::SubscriptionInit, handle, node, 0, topic);
    event.third = handle + 1;
    recording_.add(event);
    add(Kind::SubscriptionObject, handle, handle + 2);
    add(Kind::SubscriptionCallback, handle + 2, handle + 3);
    taking_[handle + 3] = handle + 1;
    return handle + 3;
  }
  Handle service(Handle node, const std::string &name) {
    const Handle handle = next_;
    next_ += 2;
    add(Kind::ServiceInit, handle, node, 0, name);
    add(Kind::CallbackAdded, handle, handle + 1);
    return handle + 1;
  }
  Handle timer(Handle node, Duration period) {
    const Handle handle = next_;
    next_ += 2;
    add(Kind::TimerInit, handle, 0, period);
    add(Kind::CallbackAdded, handle, handle + 1);
    add(Kind::TimerNode, handle, node);
    return handle + 1;
  }

  void start(std::uint32_t thread, Handle callback, bool intra_process = false) {
    thread_ = thread;
    add(Kind::Start, callback, 0, intra_process ? 1 : 0);
  }
  void take(std::uint32_t thread, Handle callback, Time sent) {
    thread_ = thread;
    add(Kind::Take, taking_.at(callback), 0, sent);
  }
  void publish(std::uint32_t thread, Handle publisher) {
    thread_ = thread;
    add(Kind::Publish, publisher);
  }
  void end(std::uint32_t thread, Handle callback) {
    thread_ = thread;
    add(Kind::End, callback);
  }
  /// A whole run of a callback at this time.
  void run(std::uint32_t thread, Handle callback, Time at, Duration length, Handle publisher = 0) {
    now = at;
    start(thread, callback);
    now = at + length;
    if (publisher != 0) publish(thread, publisher);
    end(thread, callback);
  }
  void switch_to(std::uint64_t leaving, std::uint64_t coming) { add(Kind::Switch, leaving, coming); }
  void add(Kind kind, Handle handle, Handle other = 0, std::int64_t value = 0, std::string_view name = {},
           std::string_view space = {}) {
    recording_.add(made(kind, handle, other, value, name, space));
  }

 private:
  [[nodiscard]] RosEvent made(Kind kind, Handle handle, Handle other, std::int64_t value, std::string_view name,
                              std::string_view space = {}) const {
    RosEvent event;
    event.kind = kind;
    event.time = now;
    event.process = process_;
    event.thread = thread_;
    event.handle = handle;
    event.other = other;
    event.value = value;
    event.name = name;
    event.space = space;
    event.program = "robot";
    return event;
  }

  Recording &recording_;
  std::uint32_t process_;
  std::uint32_t thread_ = 1;
  Handle next_ = 1000;
  std::map<Handle, Handle> taking_;
};

inline ImportedWorkload import(const Recording &recording, std::uint32_t process = 1) {
  Result<ImportedWorkload> imported = import_workload(recording, process);
  if (!imported) {
    ADD_FAILURE() << to_string(imported.error());
    return {};
  }
  // The file is read as it was meant.
  const Result<LoadedWorkload> loaded = parse_workload(to_yaml(*imported), "robot.yaml");
  if (loaded) {
    EXPECT_EQ(loaded->workload, imported->workload) << to_yaml(*imported);
  } else {
    ADD_FAILURE() << to_yaml(*imported) << to_string(loaded.error());
  }
  return *std::move(imported);
}

inline const Task &task_named(const ImportedWorkload &imported, const std::string &part) {
  static const Task kNone;
  for (const TaskRef &ref : flatten(imported.workload)) {
    if (ref.task->name.find(part) != std::string::npos) return *ref.task;
  }
  ADD_FAILURE() << "no task " << part << " in\n" << to_yaml(imported);
  return kNone;
}

inline std::string notes_of(const ImportedWorkload &imported, const std::string &part) {
  std::string text;
  for (const TaskRef &ref : flatten(imported.workload)) {
    if (ref.task->name.find(part) == std::string::npos) continue;
    for (const std::string &note : imported.notes[ref.id.value]) text += note + "\n";
  }
  return text;
}

inline std::string all_remarks(const ImportedWorkload &imported) {
  std::string text;
  for (const std::string &remark : imported.remarks) text += remark + "\n";
  return text;
}

}  // namespace redag::lab
