// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The units of a shard that are not finished, handed out one by one. Takes one bit for each unit of the experiment. Not
// thread-safe.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "redag_lab/experiment/shard.hpp"

namespace redag::experiment {

class PendingUnits {
 public:
  PendingUnits(std::uint64_t units, Shard shard) : shard_(shard), finished_(units) {}

  /// Leaves a unit out. Units that the experiment does not have are ignored.
  void finish(std::uint64_t unit) {
    if (unit < finished_.size()) finished_[unit] = true;
  }
  [[nodiscard]] std::uint64_t count() const {
    std::uint64_t pending = 0;
    for (std::uint64_t unit = shard_.index - 1; unit < finished_.size(); unit += shard_.count) {
      if (!finished_[unit]) ++pending;
    }
    return pending;
  }
  /// Returns the next unit in order; nothing at the end.
  [[nodiscard]] std::optional<std::uint64_t> next() {
    while (next_ < finished_.size()) {
      const std::uint64_t unit = next_++;
      if (shard_.owns(unit) && !finished_[unit]) return unit;
    }
    return std::nullopt;
  }

 private:
  Shard shard_;
  std::vector<bool> finished_;
  std::uint64_t next_ = 0;
};

}  // namespace redag::experiment
