// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The releases of one task that a program makes itself (DagBuilder::event). It keeps the minimum inter-arrival time,
// and the id of the task while an executor has it. Owns no thread. Any thread; the lock inherits priority.
#pragma once

#include <cstdint>
#include <string>

#include "redag/base/ids.hpp"
#include "redag/base/pi_mutex.hpp"
#include "redag/base/thread_annotations.hpp"
#include "redag/base/time.hpp"
#include "redag/runtime/dag_builder.hpp"

namespace redag::runtime {

class Engine;

class EventSource {
 public:
  /// `place` names the task in messages: DagBuilder("d").event("t").
  EventSource(std::string place, Duration min_interval, EarlyRelease early)
      : place_(std::move(place)), min_interval_(min_interval), early_(early) {}

  /// The engine has the task. No engine may have it already.
  void connect(Engine &engine, TaskId task) REDAG_EXCLUDES(lock_);
  [[nodiscard]] bool is_connected() const REDAG_EXCLUDES(lock_);
  /// From now on releases are made. Their times are those of the engine.
  void open() REDAG_EXCLUDES(lock_);
  /// When it returns, no release is under way or will be made.
  void disconnect() REDAG_EXCLUDES(lock_);

  /// Releases a job now. Returns false if it came too early, or if the executor is not running. Throws std::logic_error
  /// if `engine` does not have the task.
  bool release(const Engine &engine) REDAG_EXCLUDES(lock_);

  /// Releases that came before the minimum inter-arrival time had passed.
  [[nodiscard]] std::uint64_t early() const REDAG_EXCLUDES(lock_);
  [[nodiscard]] const std::string &place() const { return place_; }

 private:
  const std::string place_;
  const Duration min_interval_;
  const EarlyRelease early_;
  mutable PiMutex lock_{LockClass::Bounded};
  Engine *engine_ REDAG_GUARDED_BY(lock_) = nullptr;
  TaskId task_ REDAG_GUARDED_BY(lock_);
  bool open_ REDAG_GUARDED_BY(lock_) = false;
  Time earliest_ REDAG_GUARDED_BY(lock_) = 0;  // before it, a release is early
  std::uint64_t early_count_ REDAG_GUARDED_BY(lock_) = 0;
};

}  // namespace redag::runtime
