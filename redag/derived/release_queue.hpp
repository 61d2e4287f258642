// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The releases of timer tasks: points on a grid, each seen up to its jitter later, and a queue in the order in which
// they are seen. The simulator and the release timer share them, and so release the same jobs. No clock and no thread.
// Allocates in push() only. Not thread-safe.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <tuple>
#include <vector>

#include "redag/base/ids.hpp"
#include "redag/base/time.hpp"

namespace redag {

/// One release of a timer task.
struct TimerRelease {
  Time seen = 0;     // nominal + jitter, but never before the previous release of the task is seen
  Time nominal = 0;  // its point on the grid
  TaskId task;
  std::uint32_t number = 0;

  /// Becomes the task's next release, which is `distance` later on the grid and has this jitter.
  void advance(Duration distance, Duration jitter) {
    nominal += distance;
    ++number;
    seen = std::max(seen, nominal + jitter);
  }
};

/// The next release of each timer task, a binary heap by (seen, task, number). `Release` is a TimerRelease.
template <class Release>
class ReleaseQueue {
 public:
  void push(const Release &release) {
    heap_.push_back(release);
    std::push_heap(heap_.begin(), heap_.end(), later);
  }

  /// When the first release is to be seen; kNever: there is none.
  [[nodiscard]] Time next() const { return heap_.empty() ? kNever : heap_.front().seen; }
  [[nodiscard]] const Release &top() const { return heap_.front(); }

  /// Replaces the first release; cheaper than removing and adding. Requires one.
  void replace_top(const Release &release) {
    std::size_t hole = 0;
    for (std::size_t child = 1; child < heap_.size(); child = 2 * hole + 1) {
      if (child + 1 < heap_.size() && later(heap_[child], heap_[child + 1])) ++child;
      if (!later(release, heap_[child])) break;
      heap_[hole] = heap_[child];
      hole = child;
    }
    heap_[hole] = release;
  }

  template <class Predicate>
  void erase_if(Predicate which) {
    std::erase_if(heap_, which);
    std::make_heap(heap_.begin(), heap_.end(), later);
  }

 private:
  static bool later(const TimerRelease &a, const TimerRelease &b) {
    return std::tie(a.seen, a.task.value, a.number) > std::tie(b.seen, b.task.value, b.number);
  }

  std::vector<Release> heap_;
};

}  // namespace redag
