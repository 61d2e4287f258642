// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/experiment/shard.hpp"

#include <charconv>

#include <fmt/format.h>

namespace redag::experiment {

Result<Shard> parse_shard(std::string_view text) {
  Shard shard;
  const char *end = text.data() + text.size();
  const auto [slash, bad_index] = std::from_chars(text.data(), end, shard.index);
  if (bad_index == std::errc() && slash != end && *slash == '/') {
    const auto [stop, bad_count] = std::from_chars(slash + 1, end, shard.count);
    if (bad_count == std::errc() && stop == end && shard.index >= 1 && shard.index <= shard.count) return shard;
  }
  return make_error(fmt::format("'{}' is not a shard", text), "write i/n with 1 <= i <= n, such as 1/4");
}

std::string to_string(const Shard &shard) { return fmt::format("{}/{}", shard.index, shard.count); }

}  // namespace redag::experiment
