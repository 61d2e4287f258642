// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Seeds of the units of an experiment. Each unit has a seed of its own, derived from the unit's definition and not from
// the number of other units. Pure.
#pragma once

#include <cstdint>
#include <initializer_list>

#include "redag/base/rng.hpp"

namespace redag::experiment {

/// Derives the seed of the coordinates, in this order. Other coordinates have another seed.
[[nodiscard]] constexpr std::uint64_t derive_seed(std::uint64_t seed,
                                                  std::initializer_list<std::uint64_t> coordinates) {
  std::uint64_t derived = mix(seed);
  for (const std::uint64_t coordinate : coordinates) derived = mix(derived ^ mix(coordinate + 1));
  return derived;
}

}  // namespace redag::experiment
