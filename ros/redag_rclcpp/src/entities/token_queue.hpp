// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// TokenQueue is a FIFO in a ring that grows by doubling. It allocates only while it grows. Not thread-safe.
#pragma once

#include <cstddef>
#include <utility>
#include <vector>

namespace redag_rclcpp {

template <class T>
class TokenQueue {
 public:
  [[nodiscard]] bool empty() const { return size_ == 0; }
  [[nodiscard]] std::size_t size() const { return size_; }
  [[nodiscard]] const T &front() const { return ring_[first_]; }
  [[nodiscard]] T &at(std::size_t position) { return ring_[(first_ + position) % ring_.size()]; }
  [[nodiscard]] const T &at(std::size_t position) const { return ring_[(first_ + position) % ring_.size()]; }

  void push(T value) {
    if (size_ == ring_.size()) grow();
    ring_[(first_ + size_++) % ring_.size()] = std::move(value);
  }

  T pop() {
    T value = std::move(ring_[first_]);
    first_ = (first_ + 1) % ring_.size();
    --size_;
    return value;
  }

  void clear() { size_ = 0; }

  /// Removes the value at `position`; later values move up.
  void erase(std::size_t position) {
    for (std::size_t i = position; i + 1 < size_; ++i) {
      ring_[(first_ + i) % ring_.size()] = std::move(ring_[(first_ + i + 1) % ring_.size()]);
    }
    --size_;
  }

 private:
  void grow() {
    std::vector<T> larger(ring_.empty() ? 4 : 2 * ring_.size());
    for (std::size_t i = 0; i < size_; ++i) larger[i] = std::move(ring_[(first_ + i) % ring_.size()]);
    ring_.swap(larger);
    first_ = 0;
  }

  std::vector<T> ring_;
  std::size_t first_ = 0;
  std::size_t size_ = 0;
};

}  // namespace redag_rclcpp
