// Durations in buckets that grow with them (8 an octave: a percentile is at most 1/8 above the true one). Any thread;
// adding allocates nothing and takes no lock.
#pragma once

#include <algorithm>
#include <array>
#include <atomic>
#include <bit>
#include <cstdint>

#include "redag/base/time.hpp"

namespace redag_rclcpp {

class Histogram {
 public:
  void add(redag::Duration value) noexcept {
    value = std::max<redag::Duration>(value, 0);
    buckets_[bucket_of(static_cast<std::uint64_t>(value))].fetch_add(1, std::memory_order_relaxed);
    redag::Duration longest = longest_.load(std::memory_order_relaxed);
    while (value > longest && !longest_.compare_exchange_weak(longest, value, std::memory_order_relaxed)) {
    }
  }

  [[nodiscard]] redag::Duration longest() const noexcept { return longest_.load(std::memory_order_relaxed); }

  /// The smallest bound that at least `share` of the values do not exceed; 0 without values.
  [[nodiscard]] redag::Duration percentile(double share) const noexcept {
    std::uint64_t total = 0;
    for (const auto &bucket : buckets_) total += bucket.load(std::memory_order_relaxed);
    const auto wanted = static_cast<std::uint64_t>(share * static_cast<double>(total));
    std::uint64_t seen = 0;
    for (std::size_t i = 0; i < buckets_.size(); ++i) {
      seen += buckets_[i].load(std::memory_order_relaxed);
      if (seen > 0 && seen >= wanted) return std::min(longest(), upper_bound_of(i));
    }
    return 0;
  }

 private:
  static constexpr unsigned kBits = 3;  // 8 buckets an octave
  static constexpr unsigned kOctaves = 44;

  static std::size_t bucket_of(std::uint64_t value) noexcept {
    const auto width = static_cast<unsigned>(std::bit_width(value));
    if (width <= kBits + 1) return static_cast<std::size_t>(value);
    const unsigned shift = width - kBits - 1;
    const std::size_t index = (static_cast<std::size_t>(shift) << kBits) + static_cast<std::size_t>(value >> shift);
    return std::min<std::size_t>(index, (kOctaves << kBits) - 1);
  }
  static redag::Duration upper_bound_of(std::size_t index) noexcept {
    if (index < (std::size_t{2} << kBits)) return static_cast<redag::Duration>(index);
    const std::size_t shift = (index >> kBits) - 1;
    const std::size_t leading = index - (shift << kBits);
    return static_cast<redag::Duration>(((leading + 1) << shift) - 1);
  }

  std::array<std::atomic<std::uint32_t>, kOctaves << kBits> buckets_{};
  std::atomic<redag::Duration> longest_{0};
};

}  // namespace redag_rclcpp
