// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Seeds of the units of an experiment: each unit draws from a seed of its own, which depends on what the unit is and
// not on how many others there are. Pure.
#pragma once

#include <cstdint>
#include <initializer_list>

#include "redag/base/rng.hpp"

namespace redag::experiment {

/// The seed of what `coordinates` name, in this order: another seed for other coordinates.
[[nodiscard]] constexpr std::uint64_t derive_seed(std::uint64_t seed,
                                                  std::initializer_list<std::uint64_t> coordinates) {
  std::uint64_t derived = mix(seed);
  for (const std::uint64_t coordinate : coordinates) derived = mix(derived ^ mix(coordinate + 1));
  return derived;
}

}  // namespace redag::experiment
