// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Which thread ran which job: a ring that any thread writes to and one reads. A full ring drops jobs. Each slot counts
// the turns of both sides (D. Vyukov's bounded queue), so that no writer waits for another one.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "redag/base/atomic.hpp"
#include "redag_analysis/metrics/kernel_record.hpp"

namespace redag::lab {

class JobLog {
 public:
  /// `capacity` is a power of two.
  explicit JobLog(std::size_t capacity = std::size_t{1} << 16U) : slots_(capacity), mask_(capacity - 1) {
    for (std::size_t i = 0; i < capacity; ++i) slots_[i].turn.store(i, std::memory_order_relaxed);
  }

  /// Any thread.
  void push(const metrics::JobThread &job) noexcept {
    std::uint64_t at = tail_.load(std::memory_order_relaxed);
    for (;;) {
      Slot &slot = slots_[at & mask_];
      const std::uint64_t turn = slot.turn.load(std::memory_order_acquire);
      if (turn < at) return;  // the reader has not taken the job of the last round
      if (turn > at) {
        at = tail_.load(std::memory_order_relaxed);
      } else if (tail_.compare_exchange_weak(at, at + 1, std::memory_order_relaxed)) {
        slot.job = job;
        slot.turn.store(at + 1, std::memory_order_release);
        return;
      }
    }
  }

  /// Passes the jobs to `take`, the oldest first. One thread.
  template <class Take>
  void drain(Take take) {
    for (;; ++head_) {
      Slot &slot = slots_[head_ & mask_];
      if (slot.turn.load(std::memory_order_acquire) != head_ + 1) return;
      take(slot.job);
      slot.turn.store(head_ + slots_.size(), std::memory_order_release);
    }
  }

 private:
  struct Slot {
    Atomic<std::uint64_t> turn{0};
    metrics::JobThread job;
  };

  std::vector<Slot> slots_;
  std::uint64_t mask_;
  Atomic<std::uint64_t> tail_{0};
  std::uint64_t head_ = 0;
};

}  // namespace redag::lab
