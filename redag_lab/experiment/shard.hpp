// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The share of an experiment's units that one of several machines runs. Shard i of n has the units u with
// u mod n = i - 1. Plain values.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <string_view>

#include "redag/base/result.hpp"

namespace redag::experiment {

struct Shard {
  std::uint32_t index = 1;  // from 1
  std::uint32_t count = 1;

  [[nodiscard]] constexpr bool owns(std::uint64_t unit) const { return unit % count == index - 1; }
  friend bool operator==(const Shard &, const Shard &) = default;
};

/// Parses "2/4". Error: another form, or not 1 <= i <= n.
[[nodiscard]] Result<Shard> parse_shard(std::string_view text);
[[nodiscard]] std::string to_string(const Shard &shard);

/// Looks up a variable of the environment; null if it is not set, as std::getenv().
using Variables = std::function<const char *(const char *name)>;
/// Returns the share of this process among those that a scheduler started: a task of a Slurm array, a task of srun,
/// both together, or a rank of mpirun. Error: none of them, or an array with gaps, whose tasks cannot tell their place.
[[nodiscard]] Result<Shard> shard_of_environment(const Variables &variable);

}  // namespace redag::experiment
