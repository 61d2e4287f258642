// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The next release of each task, as a tournament: a binary tree whose nodes hold the earlier of two releases. A change
// compares once a level, without a branch that could be mispredicted. In a heap every comparison can be. The
// comparisons of a change also need not wait for each other's memory, because a release is one number and what it is
// compared with is known from the start. Allocates in the constructor only. Not thread-safe.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "redag/base/ids.hpp"
#include "redag/base/int128.hpp"
#include "redag/base/time.hpp"

namespace redag::sim {

class ReleaseTree {
 public:
  /// For tasks with smaller ids than `count`. None of them has a release.
  explicit ReleaseTree(std::size_t count)
      : leaves_(std::max<std::size_t>(1, count)), nodes_(2 * leaves_, Int128{kNever} << 64) {}

  /// Sets when the task's next release is seen; kNever: it has none.
  void set(TaskId task, Time seen) {
    Int128 *const nodes = nodes_.data();
    std::size_t at = leaves_ + task.value;
    Int128 first = (Int128{seen} << 64) | task.value;
    for (nodes[at] = first; at > 1; nodes[at] = first) {
      first = std::min<Int128>(first, nodes[at ^ 1U]);
      at /= 2;
    }
  }

  /// When the first release is seen; kNever: there is none.
  [[nodiscard]] Time next() const { return static_cast<Time>(nodes_[1] >> 64); }
  /// Its task; of several releases at one time, the smallest TaskId.
  [[nodiscard]] TaskId task() const { return TaskId(static_cast<std::uint32_t>(nodes_[1])); }

 private:
  std::size_t leaves_;
  // The time at which a release is seen in the upper half, its TaskId in the lower. 1 is the root; 2 n and 2 n + 1 are
  // below n.
  std::vector<Int128> nodes_;
};

}  // namespace redag::sim
