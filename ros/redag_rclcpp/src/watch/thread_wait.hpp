// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Tells what another thread of this process waits for, as Linux shows it in /proc. No state; any thread.
#pragma once

#include <cstdint>

namespace redag_rclcpp {

enum class ThreadWait : std::uint8_t {
  None,     // the thread runs, or could run
  Future,   // a std::future of a std::promise, as those of rclcpp's clients are
  Other,    // a sleep, a condition variable, a lock, a file, ...
  Unknown,  // the system does not tell
};

/// `thread` is the kernel's number of the thread. Costs two or four system calls.
[[nodiscard]] ThreadWait wait_of_thread(int thread) noexcept;

}  // namespace redag_rclcpp
