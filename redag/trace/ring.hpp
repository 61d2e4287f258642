// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// A ring of values from one writing thread to one reading thread. Owns its storage, which is allocated once. push()
// never blocks or allocates; a value that does not fit is dropped and counted. Threads: push() from one thread, pop()
// and drain() from one other; capacity(), pushed() and dropped() from any.
#pragma once

#include <algorithm>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "redag/base/atomic.hpp"
#include "redag/model/job_event.hpp"

namespace redag::trace {

template <class T>
class RingOf {
 public:
  /// Makes room for at least `capacity` values (rounded up to a power of two, >= 2).
  explicit RingOf(std::size_t capacity)
      : slots_(std::bit_ceil(std::max<std::size_t>(capacity, 2))), mask_(slots_.size() - 1) {}

  RingOf(const RingOf &) = delete;
  RingOf &operator=(const RingOf &) = delete;

  /// Producer only. Returns false if the ring was full and the value is lost.
  bool push(const T &value) noexcept {
    const std::uint64_t tail = producer_.index.load(std::memory_order_relaxed);
    if (tail - producer_.other >= slots_.size()) {
      // Reads the reader's index only when the last known one says "full": no cache line bounces in steady state.
      producer_.other = consumer_.index.load(std::memory_order_acquire);
      if (tail - producer_.other >= slots_.size()) {
        dropped_.store(dropped_.load(std::memory_order_relaxed) + 1, std::memory_order_relaxed);
        return false;
      }
    }
    slots_[tail & mask_] = value;
    producer_.index.store(tail + 1, std::memory_order_release);
    return true;
  }

  /// Consumer only. Moves the oldest values to `out`; returns how many.
  std::size_t pop(std::span<T> out) noexcept {
    const std::uint64_t head = consumer_.index.load(std::memory_order_relaxed);
    if (consumer_.other - head < out.size()) consumer_.other = producer_.index.load(std::memory_order_acquire);
    const std::size_t count = std::min<std::size_t>(consumer_.other - head, out.size());
    for (std::size_t i = 0; i < count; ++i) out[i] = slots_[(head + i) & mask_];
    consumer_.index.store(head + count, std::memory_order_release);
    return count;
  }

  /// Consumer only. Appends all available values to `out`; returns how many.
  std::size_t drain(std::vector<T> &out) {
    const std::uint64_t head = consumer_.index.load(std::memory_order_relaxed);
    const std::size_t count = producer_.index.load(std::memory_order_acquire) - head;
    const std::size_t before = out.size();
    out.resize(before + count);
    return pop(std::span(out).subspan(before));
  }

  [[nodiscard]] std::size_t capacity() const noexcept { return slots_.size(); }

  /// Number of values lost so far because the reader was behind.
  [[nodiscard]] std::uint64_t dropped() const noexcept { return dropped_.load(std::memory_order_relaxed); }

  /// Number of values accepted so far.
  [[nodiscard]] std::uint64_t pushed() const noexcept { return producer_.index.load(std::memory_order_acquire); }

 private:
  // std::hardware_destructive_interference_size changes with compiler flags; 64 is right for x86-64 and most of ARM.
  static constexpr std::size_t kCacheLine = 64;

  // One end of the ring: its own index, which the other end reads, and the last known index of the other end.
  struct alignas(kCacheLine) End {
    Atomic<std::uint64_t> index{0};
    std::uint64_t other = 0;
  };

  std::vector<T> slots_;
  std::size_t mask_;
  End producer_;
  End consumer_;
  alignas(kCacheLine) Atomic<std::uint64_t> dropped_{0};
};

using Ring = RingOf<JobEvent>;

}  // namespace redag::trace
