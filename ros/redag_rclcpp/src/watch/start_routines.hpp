// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Tells which shared library started a thread of this process: the one that contains the function which the thread
// runs. The C library keeps this function in the thread's descriptor, but not at a documented place. StartRoutines
// finds the place with threads whose functions are known. Any thread may call it.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

#include "redag/base/result.hpp"

namespace redag_rclcpp {

class StartRoutines {
 public:
  /// Finds the place, and checks it with two more threads. Costs the creation of three threads. Error: why the C
  /// library cannot be read, for instance because a sanitizer puts a function of its own before that of the thread.
  [[nodiscard]] static redag::Result<StartRoutines> locate();

  /// Path of the library or program with the function that the thread runs. For a std::thread it is the one that
  /// created the thread. Empty: the thread has ended, or it is the main thread. `thread` is the kernel's number of the
  /// thread.
  [[nodiscard]] std::string library_of(int thread) const;

 private:
  StartRoutines() = default;

  std::size_t distance_ = 0;          // from a descriptor's list of robust mutexes to its start routine
  std::uintptr_t of_std_thread_ = 0;  // start routine of each std::thread; its argument is the object to run
};

}  // namespace redag_rclcpp
