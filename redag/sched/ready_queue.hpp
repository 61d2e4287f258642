// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Ready queues: the jobs that could run, most urgent first. Two queues share one set of operations. LevelQueue serves
// static priorities in O(1) by a bitmap; HeapQueue serves any order in O(log n) amortised. Both are intrusive (the
// links live in Job) and never allocate after construction. They hold slots; the caller passes in the jobs. Not
// thread-safe.
#pragma once

#include <bit>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "redag/sched/job.hpp"

namespace redag::sched {

/// A set of small integers with an O(1) minimum: a 64-ary tree of words. Sets of up to 64 need the root alone, and
/// those of up to 4,096 the root and its leaves. Three levels hold 262,144 members.
class LevelBitmap {
 public:
  explicit LevelBitmap(std::size_t size = 0) {
    if (size <= 64) return;
    size = (size + 63) / 64;
    leaves_.resize(size);
    while (size > 64) {
      size = (size + 63) / 64;
      upper_.emplace_back(size, 0);
    }
  }

  void set(std::uint32_t index) {
    if (!leaves_.empty()) {
      std::uint64_t &word = leaves_[index >> 6U];
      const bool was_empty = word == 0;
      word |= bit(index);
      if (!was_empty) return;
      index >>= 6U;
      if (!upper_.empty()) return set_above(index);
    }
    root_ |= bit(index);
  }

  void clear(std::uint32_t index) {
    if (!leaves_.empty()) {
      std::uint64_t &word = leaves_[index >> 6U];
      word &= ~bit(index);
      if (word != 0) return;
      index >>= 6U;
      if (!upper_.empty()) return clear_above(index);
    }
    root_ &= ~bit(index);
  }

  [[nodiscard]] bool empty() const { return root_ == 0; }

  /// The smallest member. Requires !empty().
  [[nodiscard]] std::uint32_t first() const {
    auto index = static_cast<std::uint32_t>(std::countr_zero(root_));
    if (leaves_.empty()) return index;
    if (!upper_.empty()) index = first_above(index);
    return (index << 6U) | static_cast<std::uint32_t>(std::countr_zero(leaves_[index]));
  }

 private:
  // Not inlined, so that the users of small sets stay short.
  [[gnu::noinline]] void set_above(std::uint32_t index) {
    for (auto &layer : upper_) {
      std::uint64_t &word = layer[index >> 6U];
      const bool was_empty = word == 0;
      word |= bit(index);
      if (!was_empty) return;
      index >>= 6U;
    }
    root_ |= bit(index);
  }
  [[gnu::noinline]] void clear_above(std::uint32_t index) {
    for (auto &layer : upper_) {
      std::uint64_t &word = layer[index >> 6U];
      word &= ~bit(index);
      if (word != 0) return;
      index >>= 6U;
    }
    root_ &= ~bit(index);
  }
  [[nodiscard, gnu::noinline]] std::uint32_t first_above(std::uint32_t index) const {
    for (auto layer = upper_.rbegin(); layer != upper_.rend(); ++layer) {
      index = (index << 6U) | static_cast<std::uint32_t>(std::countr_zero((*layer)[index]));
    }
    return index;
  }

  [[nodiscard]] static std::uint64_t bit(std::uint32_t index) { return std::uint64_t{1} << (index & 63U); }

  std::uint64_t root_ = 0;
  std::vector<std::uint64_t> leaves_;              // empty: the root is the only word
  std::vector<std::vector<std::uint64_t>> upper_;  // between leaves and root; [0]: next to the leaves
};

/// One list of jobs for each urgency, and a bitmap of the lists that are not empty.
class LevelQueue {
 public:
  explicit LevelQueue(std::size_t lists = 0) : bitmap_(lists), lists_(lists) {}

  /// O(1) if the job comes last in its list, as it does if jobs of a tier become ready in the order of their releases.
  /// Otherwise takes one step for each job of the list that comes after it.
  void push(std::span<Job> jobs, std::uint32_t slot, std::uint32_t to) {
    Job &job = jobs[slot];
    List &list = lists_[to];
    std::uint32_t after = list.tail;
    while (after != kNil && before(job, jobs[after])) after = jobs[after].previous;
    job.child = to;
    job.previous = after;
    job.next = after == kNil ? list.head : jobs[after].next;
    (after == kNil ? list.head : jobs[after].next) = slot;
    (job.next == kNil ? list.tail : jobs[job.next].previous) = slot;
    bitmap_.set(to);
  }

  void remove(std::span<Job> jobs, std::uint32_t slot) {
    Job &job = jobs[slot];
    List &list = lists_[job.child];
    (job.previous == kNil ? list.head : jobs[job.previous].next) = job.next;
    (job.next == kNil ? list.tail : jobs[job.next].previous) = job.previous;
    if (list.head == kNil) bitmap_.clear(job.child);
    job.child = job.next = job.previous = kNil;
  }

  /// Returns the first job's slot, or kNil.
  [[nodiscard]] std::uint32_t top() const { return bitmap_.empty() ? kNil : lists_[bitmap_.first()].head; }

 private:
  struct List {
    std::uint32_t head = kNil;
    std::uint32_t tail = kNil;
  };
  LevelBitmap bitmap_;
  std::vector<List> lists_;
};

/// A pairing heap ordered by before(). Fredman, Sedgewick, Sleator, Tarjan, Algorithmica 1 (1986). Not inlined, so that
/// those who mostly find it empty stay short.
class HeapQueue {
 public:
  [[gnu::noinline]] void push(std::span<Job> jobs, std::uint32_t slot) {
    jobs[slot].child = jobs[slot].next = jobs[slot].previous = kNil;
    root_ = root_ == kNil ? slot : meld(jobs, root_, slot);
  }

  [[gnu::noinline]] void remove(std::span<Job> jobs, std::uint32_t slot) {
    Job &job = jobs[slot];
    const std::uint32_t rest = merge_pairs(jobs, job.child);
    if (slot == root_) {
      root_ = rest;
    } else {
      // `previous` is the left sibling, or the parent of a first child.
      Job &left = jobs[job.previous];
      (left.child == slot ? left.child : left.next) = job.next;
      if (job.next != kNil) jobs[job.next].previous = job.previous;
      if (rest != kNil) root_ = meld(jobs, root_, rest);
    }
    job.child = job.next = job.previous = kNil;
  }

  [[nodiscard]] std::uint32_t top() const { return root_; }

 private:
  // Melds two roots without siblings: the later one becomes the first child of the other.
  static std::uint32_t meld(std::span<Job> jobs, std::uint32_t a, std::uint32_t b) {
    if (before(jobs[b], jobs[a])) std::swap(a, b);
    jobs[b].next = jobs[a].child;
    jobs[b].previous = a;
    if (jobs[a].child != kNil) jobs[jobs[a].child].previous = b;
    jobs[a].child = b;
    return a;
  }

  // Two passes: siblings are melded in pairs from the left, then the pairs from the right.
  static std::uint32_t merge_pairs(std::span<Job> jobs, std::uint32_t first) {
    std::uint32_t pairs = kNil;  // stack of melded pairs, linked by `previous`
    while (first != kNil) {
      const std::uint32_t a = first;
      const std::uint32_t b = jobs[a].next;
      first = b == kNil ? kNil : jobs[b].next;
      jobs[a].next = jobs[a].previous = kNil;
      std::uint32_t pair = a;
      if (b != kNil) {
        jobs[b].next = jobs[b].previous = kNil;
        pair = meld(jobs, a, b);
      }
      jobs[pair].previous = pairs;
      pairs = pair;
    }
    std::uint32_t root = kNil;
    while (pairs != kNil) {
      const std::uint32_t below = jobs[pairs].previous;
      jobs[pairs].previous = kNil;
      root = root == kNil ? pairs : meld(jobs, root, pairs);
      pairs = below;
    }
    return root;
  }

  std::uint32_t root_ = kNil;
};

}  // namespace redag::sched
