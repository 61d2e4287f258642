// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Durations for people, with four significant digits and rounded to the safe side. Pure functions.
#pragma once

#include <string>

#include "redag/base/time.hpp"

namespace redag {

/// Returns the least duration of four significant digits that is not below this one.
[[nodiscard]] Duration round_up(Duration duration);

/// As humanize_duration(), but never more than the duration: for remaining room, or a largest execution time.
[[nodiscard]] std::string humanize_down(Duration duration);

/// As humanize_duration(), but never less than the duration: for a bound, or a shortest period.
[[nodiscard]] std::string humanize_up(Duration duration);

}  // namespace redag
