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

// Keeps the `kept` largest of the values offered, with their owners.
class Largest {
 public:
  explicit Largest(std::size_t kept) : kept_(std::min(kept, kMost)) { std::fill_n(entries_.begin(), kept_, Entry{}); }

  /// True if offer() would keep this value.
  [[nodiscard]] bool accepts(Duration value) const { return kept_ != 0 && value > entries_[kept_ - 1].value; }

  void offer(Duration value, std::size_t whose = 0) {
    if (!accepts(value)) return;
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
  std::array<Entry, kMost> entries_;  // only kept_ are set: clearing all of them would take longer than a bound
};

// Returns the least d with sum_i min(w_i, d) + rest < m d, where `all` is the sum of the w_i and rest, and `largest`
// holds the m - 1 largest w_i. The j largest count for d each: d = floor((all - their sum) / (m - j)) + 1 for the j
// that makes it least. (With fewer than m - 1 values kept, d can exceed the least one; the inequality still holds.)
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

// Bounds the search for the least d with sum_i min(W_i(d), d) + rest < m d, which takes steps of least_window()
// (fixed_point.hpp). Work grows with the window, and no skipped d can satisfy the inequality. A job that waits in d
// instants would need m d of work, and therefore waits in less. Plain iteration would advance by a nanosecond a step
// while m tasks interfere in every instant.
//
// FirstWindow gives the start if each of the others does at least min(least_i, d) in the window: no smaller d can do. A
// search from 1 could advance by a nanosecond a step, because work grows as fast as the window there.
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
