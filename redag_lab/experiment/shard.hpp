// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The share of an experiment's units that one of several machines runs. Shard i of n has the units u with
// u mod n = i - 1. Plain values.
#pragma once

#include <cstdint>
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

}  // namespace redag::experiment
