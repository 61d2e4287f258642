// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The next release of each task, as a tournament: a binary tree whose nodes hold the earlier of two releases. A change
// compares once a level, without a branch that could be mispredicted. In a heap every comparison can be. Allocates in
// the constructor only. Not thread-safe.
#pragma once

#include <algorithm>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "redag/base/ids.hpp"
#include "redag/base/time.hpp"

namespace redag::sim {

class ReleaseTree {
 public:
  /// For tasks with smaller ids than `count`. None of them has a release.
  explicit ReleaseTree(std::size_t count) : leaves_(std::bit_ceil(std::max<std::size_t>(1, count))) {
    nodes_.resize(2 * leaves_);
    for (std::size_t i = 0; i < leaves_; ++i) nodes_[leaves_ + i].task = TaskId(i);
  }

  /// Sets when the task's next release is seen; kNever: it has none.
  void set(TaskId task, Time seen) {
    std::size_t at = leaves_ + task.value;
    nodes_[at].seen = seen;
    for (; at > 1; at /= 2) {
      const std::size_t left = at & ~std::size_t{1};
      const auto is_right = static_cast<std::size_t>(nodes_[left + 1].seen < nodes_[left].seen);
      nodes_[at / 2] = nodes_[left + is_right];
    }
  }

  /// When the first release is seen; kNever: there is none.
  [[nodiscard]] Time next() const { return nodes_[1].seen; }
  /// Its task; of several releases at one time, the smallest TaskId.
  [[nodiscard]] TaskId task() const { return nodes_[1].task; }

 private:
  struct Node {
    Time seen = kNever;
    TaskId task;
  };
  std::size_t leaves_;
  std::vector<Node> nodes_;  // 1 is the root; 2 n and 2 n + 1 are below n
};

}  // namespace redag::sim
