// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Hands units out in batches to the ranks of a run, and accepts the first result of each unit. Once all units are
// handed out, ranks without work do open units of other ranks again: the units of a lost rank, or of a slow one. A
// unit's result depends on the unit alone, and a rank need not be known to be lost. Not thread-safe.
#pragma once

#include <cstdint>
#include <deque>
#include <map>
#include <string>
#include <unordered_map>
#include <vector>

#include "redag/base/result.hpp"
#include "redag/base/time.hpp"
#include "redag_lab/experiment/finished_unit.hpp"
#include "redag_lab/experiment/runner.hpp"

namespace redag::experiment {

class UnitDispenser {
 public:
  static constexpr Duration kBatchTime = kSecond;  // that a batch should take, and a lost rank at most loses

  /// `next` returns `count` units. `jobs` is the number of units that a rank evaluates at the same time.
  UnitDispenser(NextUnit next, std::uint64_t count, std::uint32_t ranks, std::uint32_t jobs, Accept accept);

  /// Returns units for a rank that has none: as many as it did in kBatchTime before, fewer towards the end. Returns
  /// nothing if there is no unit that another rank does.
  [[nodiscard]] std::vector<std::uint64_t> take(std::uint32_t rank, Time now);
  /// Takes a unit's result. Ignores that of a unit which another rank has finished, and of one never handed out. Error:
  /// that of `accept`.
  [[nodiscard]] Result<void> finish(std::uint64_t unit, const std::string &result);

  [[nodiscard]] bool finished() const { return done_ == count_; }
  [[nodiscard]] std::uint64_t done() const { return done_; }
  /// The number of units that were handed out again.
  [[nodiscard]] std::uint64_t repeated() const { return repeated_; }

 private:
  struct Batch {
    Time begin = 0;
    std::uint64_t units = 0;
    std::uint64_t size = 0;  // of the next batch, before there are few units left
  };

  [[nodiscard]] std::vector<std::uint64_t> again(std::uint32_t rank, std::uint64_t size);

  NextUnit next_;
  std::uint64_t count_;
  std::uint32_t ranks_;
  std::uint32_t jobs_;
  Accept accept_;
  std::uint64_t handed_out_ = 0;
  std::uint64_t done_ = 0;
  std::uint64_t repeated_ = 0;
  std::map<std::uint32_t, Batch> batches_;                 // by rank
  std::unordered_map<std::uint64_t, std::uint32_t> open_;  // the rank that was last given a unit
  std::deque<std::uint64_t> order_;                        // open units, and some finished ones, oldest first
};

}  // namespace redag::experiment
