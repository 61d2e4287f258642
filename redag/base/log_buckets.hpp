// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Buckets whose width grows with the value: 2^kBits of them an octave. A bucket is at most 1 / 2^kBits of its values
// wide. Values below 2^(kBits + 1) have a bucket each. Pure functions.
#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>

namespace redag {

template <unsigned kBits>
struct LogBuckets {
  /// Number of buckets for 64-bit values.
  static constexpr std::size_t kCount = (std::size_t{64 - kBits} + 1) << kBits;

  [[nodiscard]] static constexpr std::size_t bucket_of(std::uint64_t value) noexcept {
    const auto width = static_cast<unsigned>(std::bit_width(value));
    if (width <= kBits + 1) return static_cast<std::size_t>(value);
    const unsigned shift = width - kBits - 1;
    return (static_cast<std::size_t>(shift) << kBits) + static_cast<std::size_t>(value >> shift);
  }

  /// The smallest and the largest value of a bucket. Requires index < kCount.
  [[nodiscard]] static constexpr std::uint64_t lowest_in(std::size_t index) noexcept {
    return index < (std::size_t{2} << kBits) ? index : leading(index) << shift(index);
  }
  [[nodiscard]] static constexpr std::uint64_t highest_in(std::size_t index) noexcept {
    if (index < (std::size_t{2} << kBits)) return index;
    return ((leading(index) << shift(index)) - 1) + (std::uint64_t{1} << shift(index));
  }

 private:
  static constexpr unsigned shift(std::size_t index) noexcept { return static_cast<unsigned>(index >> kBits) - 1; }
  static constexpr std::uint64_t leading(std::size_t index) noexcept {
    return index - (static_cast<std::size_t>(shift(index)) << kBits);
  }
};

}  // namespace redag
