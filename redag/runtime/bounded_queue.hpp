// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// A queue of values from one writer to one reader, with room for a fixed number: Lamport's ring ("Specifying Concurrent
// Program Modules", ACM TOPLAS 5(2), 1983). Each end keeps the last known place of the other, so that they share a
// cache line only when the queue looks full or empty. Both ends are wait-free, and may be preempted at any instruction.
//
// Threads: one Writer and one Reader, each used by one thread at a time.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <stdexcept>
#include <utility>
#include <vector>

#include "redag/base/atomic.hpp"

namespace redag::runtime {

template <class T>
class BoundedQueue {
  static constexpr std::size_t kCacheLine = 64;

  // One end of the queue: its place, which the other end reads, and the last known place of the other end.
  struct alignas(kCacheLine) End {
    Atomic<std::uint64_t> place{0};
    std::uint64_t other = 0;
    std::atomic<bool> taken{false};
  };

 public:
  /// The writing end. It must not outlive the queue.
  class Writer {
   public:
    Writer(Writer &&from) noexcept : queue_(std::exchange(from.queue_, nullptr)) {}
    Writer &operator=(Writer &&) = delete;
    Writer(const Writer &) = delete;
    Writer &operator=(const Writer &) = delete;
    ~Writer() {
      if (queue_ != nullptr) queue_->written_.taken = false;
    }

    /// Appends a value. Returns false, and leaves `value` as it was, if the queue is full.
    [[nodiscard]] bool push(T &&value) { return queue_->push(std::move(value)); }
    [[nodiscard]] bool push(const T &value) { return queue_->push(value); }

   private:
    friend class BoundedQueue;
    explicit Writer(BoundedQueue *queue) : queue_(queue) {}
    BoundedQueue *queue_;
  };

  /// The reading end. It must not outlive the queue.
  class Reader {
   public:
    Reader(Reader &&from) noexcept : queue_(std::exchange(from.queue_, nullptr)) {}
    Reader &operator=(Reader &&) = delete;
    Reader(const Reader &) = delete;
    Reader &operator=(const Reader &) = delete;
    ~Reader() {
      if (queue_ != nullptr) queue_->read_.taken = false;
    }

    /// Takes the oldest value; none if the queue is empty.
    [[nodiscard]] std::optional<T> pop() { return queue_->pop(); }

   private:
    friend class BoundedQueue;
    explicit Reader(BoundedQueue *queue) : queue_(queue) {}
    BoundedQueue *queue_;
  };

  /// Allocates room for `capacity` values, at least 1. Nothing allocates later, unless T does.
  explicit BoundedQueue(std::size_t capacity) : slots_(capacity) {
    if (capacity == 0) throw std::invalid_argument("BoundedQueue: the capacity must be at least 1");
  }
  BoundedQueue(const BoundedQueue &) = delete;
  BoundedQueue &operator=(const BoundedQueue &) = delete;

  /// Throws std::logic_error while the queue has a writer (or a reader). Take both before the threads that use them
  /// start.
  [[nodiscard]] Writer writer() {
    take(written_, "BoundedQueue::writer(): the queue has a writer already, and allows only one");
    return Writer(this);
  }
  [[nodiscard]] Reader reader() {
    take(read_, "BoundedQueue::reader(): the queue has a reader already, and allows only one");
    return Reader(this);
  }

  [[nodiscard]] std::size_t capacity() const noexcept { return slots_.size(); }

 private:
  static void take(End &end, const char *refusal) {
    if (end.taken.exchange(true)) throw std::logic_error(refusal);
  }

  template <class Value>
  bool push(Value &&value) {
    const std::uint64_t place = written_.place.load(std::memory_order_relaxed);
    if (place - written_.other == slots_.size()) {
      written_.other = read_.place.load(std::memory_order_acquire);
      if (place - written_.other == slots_.size()) return false;
    }
    slots_[place % slots_.size()].emplace(std::forward<Value>(value));
    written_.place.store(place + 1, std::memory_order_release);
    return true;
  }

  std::optional<T> pop() {
    const std::uint64_t place = read_.place.load(std::memory_order_relaxed);
    if (place == read_.other) {
      read_.other = written_.place.load(std::memory_order_acquire);
      if (place == read_.other) return std::nullopt;
    }
    std::optional<T> &slot = slots_[place % slots_.size()];
    std::optional<T> value = std::exchange(slot, std::nullopt);
    read_.place.store(place + 1, std::memory_order_release);
    return value;
  }

  std::vector<std::optional<T>> slots_;
  End written_;
  End read_;
};

}  // namespace redag::runtime
