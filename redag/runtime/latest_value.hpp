// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// A register that holds the latest value: one writer and a fixed number of readers, none of which ever waits or
// repeats. Algorithm: Chen and Burns, "Asynchronous Data Sharing in Multiprocessor Real-Time Systems Using Process
// Consensus" (ECRTS 1998). For n readers there are n + 2 slots; the writer finds one that is neither the latest nor
// being read. All operations on the control words are sequentially consistent, as the proof requires. A read takes
// three steps on them, a write n steps. Writer and readers may be preempted at any instruction, or run at any priority.
//
// Threads: one Writer and up to `readers` Readers, each used by one thread at a time.
#pragma once

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <stdexcept>
#include <utility>
#include <vector>

#include "redag/base/atomic.hpp"

namespace redag::runtime {

template <class T>
class LatestValue {
 public:
  /// The writing end. It must not outlive the register.
  class Writer {
   public:
    Writer(Writer &&from) noexcept : of_(std::exchange(from.of_, nullptr)) {}
    Writer &operator=(Writer &&) = delete;
    Writer(const Writer &) = delete;
    Writer &operator=(const Writer &) = delete;
    ~Writer() {
      if (of_ != nullptr) of_->has_writer_.store(false);
    }

    void write(T value) { of_->write(std::move(value)); }

   private:
    friend class LatestValue;
    explicit Writer(LatestValue *of) : of_(of) {}
    LatestValue *of_;
  };

  /// One of the reading ends. It must not outlive the register.
  class Reader {
   public:
    Reader(Reader &&from) noexcept : of_(std::exchange(from.of_, nullptr)), index_(from.index_) {}
    Reader &operator=(Reader &&) = delete;
    Reader(const Reader &) = delete;
    Reader &operator=(const Reader &) = delete;
    ~Reader() {
      if (of_ != nullptr) of_->has_reader_[index_].store(false);
    }

    /// The latest value. The reference is valid, and what it refers to unchanged, until this reader reads again.
    [[nodiscard]] const T &read() { return of_->read(index_); }
    /// Returns true if there is a newer value than that of the last read().
    [[nodiscard]] bool has_news() const { return of_->latest_.load() != of_->reading_[index_].load(); }

   private:
    friend class LatestValue;
    Reader(LatestValue *of, std::size_t index) : of_(of), index_(index) {}
    LatestValue *of_;
    std::size_t index_;
  };

  /// Holds copies of `initial` for up to `readers` readers, at least 1. Nothing allocates later, unless T does.
  explicit LatestValue(const T &initial = T{}, std::size_t readers = 1)
      : slots_(readers + 2, Slot{initial}),
        spared_(readers + 2),
        reading_(std::make_unique<Atomic<std::uint32_t>[]>(readers)),
        has_reader_(readers) {
    if (readers == 0) throw std::invalid_argument("LatestValue: the number of readers must be at least 1");
    for (std::size_t i = 0; i < readers; ++i) reading_[i] = 0;
  }
  LatestValue(const LatestValue &) = delete;
  LatestValue &operator=(const LatestValue &) = delete;

  /// Throws std::logic_error while the register has a writer. Take writer and readers before the threads that use them
  /// start.
  [[nodiscard]] Writer writer() {
    if (has_writer_.exchange(true)) {
      throw std::logic_error("LatestValue::writer(): the register has a writer already, and allows only one");
    }
    return Writer(this);
  }
  /// Throws std::logic_error while the register has as many readers as its constructor was told.
  [[nodiscard]] Reader reader() {
    for (std::size_t i = 0; i < has_reader_.size(); ++i) {
      if (!has_reader_[i].exchange(true)) return Reader(this, i);
    }
    throw std::logic_error(
        "LatestValue::reader(): the register has all its readers already (pass their number to its constructor)");
  }

 private:
  static constexpr std::uint32_t kUndecided = UINT32_MAX;

  struct Slot {
    T value;
  };

  // A reader first says that it is undecided. Then it proposes the slot that is the latest, and the writer proposes
  // each slot that becomes the latest. The first proposal decides: the reader reads that slot, and the writer spares
  // it.
  const T &read(std::size_t reader) {
    Atomic<std::uint32_t> &reading = reading_[reader];
    reading.store(kUndecided);
    std::uint32_t slot = latest_.load();
    std::uint32_t decided = kUndecided;
    if (!reading.compare_exchange_strong(decided, slot)) slot = decided;
    return slots_[slot].value;
  }

  void write(T &&value) {
    const std::uint32_t slot = free_slot();
    slots_[slot].value = std::move(value);
    latest_.store(slot);
    for (std::size_t i = 0; i < has_reader_.size(); ++i) {
      std::uint32_t undecided = kUndecided;
      reading_[i].compare_exchange_strong(undecided, slot);
    }
  }

  // A reader that is still undecided can only decide for the latest slot, which is not free: every earlier one was
  // proposed to it before another became the latest.
  std::uint32_t free_slot() {
    std::fill(spared_.begin(), spared_.end(), false);
    spared_[latest_.load()] = true;
    for (std::size_t i = 0; i < has_reader_.size(); ++i) {
      if (const std::uint32_t slot = reading_[i].load(); slot != kUndecided) spared_[slot] = true;
    }
    std::uint32_t free = 0;
    while (spared_[free]) ++free;  // there is one: n + 1 of n + 2 slots at most are spared
    return free;
  }

  std::vector<Slot> slots_;
  std::vector<bool> spared_;  // the writer's
  Atomic<std::uint32_t> latest_{0};
  std::unique_ptr<Atomic<std::uint32_t>[]> reading_;
  // The two ends may be given back by the threads that used them. No value depends on the order of these.
  std::vector<std::atomic<bool>> has_reader_;
  std::atomic<bool> has_writer_{false};
};

}  // namespace redag::runtime
