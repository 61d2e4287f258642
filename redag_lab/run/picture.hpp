// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Draws the picture of a recorded run.
#pragma once

#include <functional>
#include <string>

#include "redag/base/result.hpp"
#include "redag/trace/events_file.hpp"

namespace redag::lab {

/// Reads the rest of `events` and writes the file `picture` (metrics::PerfettoWriter), in memory that does not grow
/// with the run. `is_stopped` is asked now and then: no picture is written once it is true, which
/// is an error.
[[nodiscard]] Result<void> draw_picture(trace::EventsReader &events, const std::string &picture,
                                        const std::function<bool()> &is_stopped);

}  // namespace redag::lab
