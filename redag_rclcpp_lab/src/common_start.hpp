// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Processes that prepare their runs each by itself, and then begin at one instant. A process that is ready prints
// "ready" on its standard output. When all are, each reads "start TIME" from its standard input.
#pragma once

#include <string>
#include <vector>

#include "redag/base/result.hpp"
#include "redag/base/time.hpp"

namespace redag_rclcpp::lab {

/// Starts a process for each of `commands` (a program's path and its arguments), and waits for their ends. `margin`
/// lies between the last "ready" and the start. Returns the exit statuses, -1 after a signal. `interrupted` is asked
/// after a signal and once a second: when it says yes, each process gets a SIGINT. If that comes before the start, or
/// if a process ends before it, the processes read the end of their input instead. Error: a process cannot be started.
[[nodiscard]] redag::Result<std::vector<int>> run_together(const std::vector<std::vector<std::string>> &commands,
                                                           redag::Duration margin, bool (*interrupted)());

/// To be called in such a process when it is ready. Returns the start, on timer_clock_now(). Error: there is none.
[[nodiscard]] redag::Result<redag::Time> await_start();

}  // namespace redag_rclcpp::lab
