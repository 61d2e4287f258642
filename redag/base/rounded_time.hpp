// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Durations for people that must not promise more than they are: four significant digits, rounded to the safe side.
#pragma once

#include <string>

#include "redag/base/time.hpp"

namespace redag {

/// The least duration of four significant digits that is not below this one.
[[nodiscard]] Duration round_up(Duration duration);

/// As humanize_duration(), never more than the duration: room that is left, a largest execution time.
[[nodiscard]] std::string humanize_down(Duration duration);

/// Never less than the duration: a bound, a shortest period.
[[nodiscard]] std::string humanize_up(Duration duration);

}  // namespace redag
