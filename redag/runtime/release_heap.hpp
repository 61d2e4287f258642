// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// When timer tasks release next: the release grid, jitter and order, without a clock or a thread. Allocates in add()
// only. Not thread-safe.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "redag/base/ids.hpp"
#include "redag/model/workload.hpp"
#include "redag/runtime/engine.hpp"

namespace redag::runtime {

class ReleaseHeap {
 public:
  /// `seed`: of the release jitter.
  explicit ReleaseHeap(std::uint64_t seed) : seed_(seed) {}

  /// Job k of a timer task is released at base + offset + k * period; data tasks are ignored.
  void add(const Task &task, TaskId id, Time base);
  /// These tasks release no more.
  void remove(std::span<const TaskId> tasks);

  /// When the next release is to be seen; kNever if there is none.
  [[nodiscard]] Time next() const { return heap_.empty() ? kNever : heap_.front().seen; }

  /// Appends every release to be seen at or before `now`, in order, until `out` is full (its capacity): none is left
  /// out, however late the call.
  void pop_due(Time now, std::vector<Release> &out);

 private:
  struct Entry {
    Time seen = 0;  // nominal + jitter
    Time nominal = 0;
    TaskId id;
    std::uint32_t number = 0;
    Duration period = 0;
    Duration jitter = 0;
  };
  static bool later(const Entry &a, const Entry &b);
  [[nodiscard]] Duration jitter(const Entry &entry);

  std::vector<Entry> heap_;
  Task task_;  // what release_jitter() reads
  std::uint64_t seed_;
};

}  // namespace redag::runtime
