// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Random numbers that are the same on every machine and standard library; <random>'s distributions are not. Generator:
// xoshiro256++ seeded through SplitMix64 (Blackman & Vigna, https://prng.di.unimi.it). Not thread-safe.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <numbers>

#include "redag/base/int128.hpp"

namespace redag {

/// One step of SplitMix64. Also a good mixing function for seeds made from several numbers.
[[nodiscard]] constexpr std::uint64_t mix(std::uint64_t x) {
  x += 0x9e3779b97f4a7c15ULL;
  x = (x ^ (x >> 30U)) * 0xbf58476d1ce4e5b9ULL;
  x = (x ^ (x >> 27U)) * 0x94d049bb133111ebULL;
  return x ^ (x >> 31U);
}

class Rng {
 public:
  using result_type = std::uint64_t;

  explicit constexpr Rng(std::uint64_t seed) {
    for (auto &word : state_) {
      word = mix(seed);
      seed += 0x9e3779b97f4a7c15ULL;
    }
  }

  /// Returns a separate generator for each (stream, index): what job k of task i draws depends on no other job.
  [[nodiscard]] static constexpr Rng stream(std::uint64_t seed, std::uint64_t stream, std::uint64_t index) {
    return Rng(mix(mix(seed) ^ mix(stream * 2 + 1) ^ mix(index * 2) * 3));
  }

  static constexpr result_type min() { return 0; }
  static constexpr result_type max() { return ~0ULL; }

  constexpr result_type operator()() {
    const auto rotl = [](std::uint64_t x, unsigned k) { return (x << k) | (x >> (64U - k)); };
    const std::uint64_t result = rotl(state_[0] + state_[3], 23U) + state_[0];
    const std::uint64_t t = state_[1] << 17U;
    state_[2] ^= state_[0];
    state_[3] ^= state_[1];
    state_[1] ^= state_[2];
    state_[0] ^= state_[3];
    state_[2] ^= t;
    state_[3] = rotl(state_[3], 45U);
    return result;
  }

  /// Uniform in [0, 1), with 53 random bits.
  constexpr double uniform01() { return static_cast<double>((*this)() >> 11U) * 0x1.0p-53; }

  /// Uniform in [low, high], both included. Requires low <= high.
  constexpr std::int64_t uniform(std::int64_t low, std::int64_t high) {
    const auto span = static_cast<std::uint64_t>(high) - static_cast<std::uint64_t>(low) + 1;
    if (span == 0) return static_cast<std::int64_t>((*this)());
    const auto scaled = static_cast<Uint128>((*this)()) * span;
    return static_cast<std::int64_t>(static_cast<std::uint64_t>(low) + static_cast<std::uint64_t>(scaled >> 64U));
  }

  /// Standard normal (Box-Muller, one value of each pair).
  double normal() {
    const double u = 1.0 - uniform01();
    const double v = uniform01();
    return std::sqrt(-2.0 * std::log(u)) * std::cos(2.0 * std::numbers::pi * v);
  }

 private:
  std::array<std::uint64_t, 4> state_{};
};

}  // namespace redag
