// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// A finished unit of an experiment: its number and its result. Plain values.
#pragma once

#include <cstdint>
#include <functional>
#include <string>

#include "redag/base/result.hpp"

namespace redag::experiment {

struct FinishedUnit {
  std::uint64_t unit = 0;
  std::string result;  // the experiment's result text, without line breaks

  friend bool operator==(const FinishedUnit &, const FinishedUnit &) = default;
};

/// The hint for a unit that the plan does not have, or whose result it cannot read.
inline constexpr const char *kDamagedUnit = "units.db is damaged: delete this row, and the unit is run again";

/// Receives finished units one at a time, on any thread.
using Accept = std::function<Result<void>(std::uint64_t unit, const std::string &result)>;

}  // namespace redag::experiment
