// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// A warning about periods that fit no others, for the reader of workload files. Pure functions.
#pragma once

#include <functional>
#include <optional>
#include <string>

#include "redag/loader/validate.hpp"

namespace redag {

/// Returns the whole rate in Hz, up to 1000, whose period is not exact and was rounded to this one; nothing if there is
/// none. 33'333'333 ns is what 30 Hz is read as. A shorter period can be near that of some whole rate by chance.
[[nodiscard]] std::optional<Duration> rounded_rate(Duration period);

/// "12ms", exactly; from an hour on in hours or days. Nothing: longer than kMaxDuration.
[[nodiscard]] std::string hyperperiod_text(std::optional<Duration> hyperperiod);

/// Warns about the first timer task whose odd period makes the hyperperiod longer than an hour, if round periods near
/// the odd ones make it shorter. 33.333333ms beside 10ms is odd; 33ms and 34ms are round. `is_meant` excepts tasks.
[[nodiscard]] std::optional<Finding> hyperperiod_warning(const Workload &workload,
                                                         const std::function<bool(const TaskRef &)> &is_meant);

}  // namespace redag
