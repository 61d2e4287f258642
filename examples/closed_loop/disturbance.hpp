// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Runs another program that takes processors and caches from the threads under test, for the lifetime of the object.
// Not thread-safe.
#pragma once

#include <sys/types.h>

#include <string>
#include <vector>

namespace closed_loop {

/// Returns the command line of stress-ng with these arguments (separated by blanks), without a time limit.
[[nodiscard]] std::vector<std::string> stress_ng(const std::string &arguments);

class Disturbance {
 public:
  /// Starts a program in a process group of its own, which dies with this process however that ends. Throws
  /// std::runtime_error if the program cannot be started or has already ended.
  explicit Disturbance(std::vector<std::string> words);
  /// Ends the whole group and waits for it: SIGTERM first, then SIGKILL for processes left after three seconds.
  ~Disturbance();
  Disturbance(const Disturbance &) = delete;
  Disturbance &operator=(const Disturbance &) = delete;

  /// Throws std::runtime_error if the program has ended. Measurements since then were not disturbed.
  void expect_running();

 private:
  [[nodiscard]] bool has_ended();

  std::string name_;
  pid_t child_ = 0;  // process and group id; 0 once it has been waited for
};

}  // namespace closed_loop
