// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Replaces redag/base/atomic.hpp: every access is an operation of the explorer. Accesses are sequentially consistent,
// whatever order is requested.
#pragma once

#include <atomic>
#include <utility>

#include "tests/testing/explorer.hpp"

namespace redag {

template <class T>
class Atomic {
 public:
  Atomic(T value = T{}) noexcept : value_(value) {}  // NOLINT: as std::atomic
  Atomic(const Atomic &) = delete;
  Atomic &operator=(const Atomic &) = delete;

  T load(std::memory_order = std::memory_order_seq_cst) const noexcept {
    testing::explored::read(id_, "load");
    return value_;
  }
  void store(T value, std::memory_order = std::memory_order_seq_cst) noexcept {
    testing::explored::write(id_, "store");
    value_ = value;
  }
  T exchange(T value, std::memory_order = std::memory_order_seq_cst) noexcept {
    testing::explored::write(id_, "exchange");
    return std::exchange(value_, value);
  }
  T fetch_add(T by, std::memory_order = std::memory_order_seq_cst) noexcept {
    testing::explored::write(id_, "fetch_add");
    return std::exchange(value_, static_cast<T>(value_ + by));
  }
  T fetch_sub(T by, std::memory_order = std::memory_order_seq_cst) noexcept {
    testing::explored::write(id_, "fetch_sub");
    return std::exchange(value_, static_cast<T>(value_ - by));
  }
  T fetch_or(T bits, std::memory_order = std::memory_order_seq_cst) noexcept {
    testing::explored::write(id_, "fetch_or");
    return std::exchange(value_, static_cast<T>(value_ | bits));
  }
  bool compare_exchange_strong(T &expected, T desired, std::memory_order = std::memory_order_seq_cst,
                               std::memory_order = std::memory_order_seq_cst) noexcept {
    testing::explored::write(id_, "compare_exchange");
    if (value_ == expected) {
      value_ = desired;
      return true;
    }
    expected = value_;
    return false;
  }
  operator T() const noexcept { return load(); }  // NOLINT: as std::atomic
  T operator=(T value) noexcept {                 // NOLINT: as std::atomic
    store(value);
    return value;
  }

  // For callers that read the value within one operation: the futex.
  [[nodiscard]] testing::ObjectId id() const noexcept { return id_; }
  [[nodiscard]] T peek() const noexcept { return value_; }

 private:
  T value_;
  testing::ObjectId id_ = testing::explored::new_object();
};

}  // namespace redag
