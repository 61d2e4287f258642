// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// How long a job can wait while all workers execute others: the arithmetic that the bounds for independent tasks on m
// workers share. Pure functions that allocate nothing.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "redag_analysis/many_workers/global.hpp"

namespace redag::analysis::global {

// The `kept` largest of the values offered, with what they belong to; a few workers need a few.
class Largest {
 public:
  explicit Largest(std::size_t kept) : kept_(std::min(kept, kMost)) { std::fill_n(entries_.begin(), kept_, Entry{}); }

  void offer(Duration value, std::size_t whose = 0) {
    if (kept_ == 0 || value <= entries_[kept_ - 1].value) return;
    std::size_t i = kept_ - 1;
    for (; i > 0 && entries_[i - 1].value < value; --i) entries_[i] = entries_[i - 1];
    entries_[i] = {value, whose};
  }

  struct Entry {
    Duration value;
    std::size_t whose;
  };
  [[nodiscard]] std::span<const Entry> entries() const { return std::span(entries_).first(kept_); }

  static constexpr std::size_t kMost = 64;

 private:
  std::size_t kept_;
  std::array<Entry, kMost> entries_;  // of which kept_ have values: to clear all of them takes longer than a bound
};

// Least d with sum_i min(w_i, d) + rest < m d, where `all` is the sum of the w_i and rest, and `largest` holds the m -
// 1 largest w_i. The j largest count for d each: d = floor((all - their sum) / (m - j)) + 1 for the j that makes it
// least. (With fewer than m - 1 values kept d can be larger than the least one; it keeps the inequality.)
[[nodiscard]] inline Duration least_window(Duration all, std::span<const Largest::Entry> largest,
                                           std::uint32_t workers) {
  auto share = static_cast<Duration>(workers);
  Duration least = all / share + 1;
  for (const Largest::Entry &entry : largest) {
    if (entry.value < least) break;
    all -= entry.value;
    --share;
    least = std::min(least, all / share + 1);
  }
  return least;
}

// The least d with sum_i min(W_i(d), d) + rest < m d is sought by steps of least_window() (fixed_point.hpp): work grows
// with the window, so no d that one of them skips can do. That a job waits in d instants would take m d of work, so it
// waits in less. Plain iteration instead creeps, a nanosecond a step, while m tasks interfere in every instant.
//
// This says where to begin if each of the others does at least min(least_i, d) in the window: no smaller d does. From 1
// on, where work grows as fast as the window, one step a nanosecond would be all that as many others as workers allow.
class FirstWindow {
 public:
  FirstWindow(std::uint32_t workers, Duration rest) : workers_(workers), sum_(rest), largest_(workers - 1) {}

  void add(Duration least) {
    sum_ += least;
    largest_.offer(least);
  }

  [[nodiscard]] Duration length() const { return least_window(sum_, largest_.entries(), workers_); }

 private:
  std::uint32_t workers_;
  Duration sum_;
  Largest largest_;
};

}  // namespace redag::analysis::global
