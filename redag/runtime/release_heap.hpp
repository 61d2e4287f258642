// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Computes when timer tasks release next, without clock or thread: the release queue with the jitter that a seed draws.
// Allocates in add() only. Not thread-safe.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "redag/base/ids.hpp"
#include "redag/derived/release_queue.hpp"
#include "redag/engine/engine.hpp"
#include "redag/model/workload.hpp"

namespace redag::runtime {

class ReleaseHeap {
 public:
  /// `seed` is that of the release jitter.
  explicit ReleaseHeap(std::uint64_t seed) : seed_(seed) {}

  /// Job k of a timer task is released at base + offset + k * period, whenever a thread sees it: a late timer must not
  /// make responses look shorter. Data tasks are ignored.
  void add(const Task &task, TaskId id, Time base);
  /// Ends the releases of these tasks.
  void remove(std::span<const TaskId> tasks);

  /// When the next release is to be seen; kNever: there is none.
  [[nodiscard]] Time next() const { return queue_.next(); }

  /// Appends every release to be seen at or before `now`, in order, until `out` is full (its capacity). No release is
  /// left out, however late the call.
  void pop_due(Time now, std::vector<Release> &out);

 private:
  struct Entry : TimerRelease {
    Duration period = 0;
    Duration jitter = 0;
  };
  [[nodiscard]] Duration jitter(const Entry &entry, std::uint32_t number);

  ReleaseQueue<Entry> queue_;
  Task task_;  // the input of release_jitter()
  std::uint64_t seed_;
};

}  // namespace redag::runtime
