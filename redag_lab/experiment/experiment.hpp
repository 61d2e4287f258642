// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// An experiment of any kind: numbered units, each with a result of one line that follows from the plan alone.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "redag/base/result.hpp"
#include "redag_lab/experiment/results.hpp"

namespace redag::experiment {

/// Units are numbered repetition by repetition. An interrupted run has therefore covered all points evenly.
class Experiment {
 public:
  Experiment() = default;
  Experiment(const Experiment &) = delete;
  Experiment &operator=(const Experiment &) = delete;
  virtual ~Experiment() = default;

  [[nodiscard]] virtual std::uint64_t unit_count() const = 0;
  /// True if units run one at a time on an otherwise idle machine, because other load affects their results.
  [[nodiscard]] virtual bool takes_turns() const { return false; }
  /// Orders the units still to do, for one at a time.
  virtual void arrange(std::vector<std::uint64_t> & /*units*/) const {}

  /// Returns the result of a unit. Several threads call it at once, unless takes_turns().
  [[nodiscard]] virtual Result<std::string> evaluate(std::uint64_t unit) const = 0;
  /// Counts the result of a unit, once each, in any order. Error: a unit or a result that the plan does not have.
  [[nodiscard]] virtual Result<void> add(std::uint64_t unit, const std::string &result) = 0;
  /// Returns the results of the units so far.
  [[nodiscard]] virtual Result<Results> results() const = 0;
};

}  // namespace redag::experiment
