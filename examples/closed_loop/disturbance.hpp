// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Another program that takes processors and caches from the threads under test, as long as this object lives. Not
// thread-safe.
#pragma once

#include <sys/types.h>

#include <string>
#include <vector>

namespace closed_loop {

/// stress-ng with these arguments, separated by blanks, until it is told to stop.
[[nodiscard]] std::vector<std::string> stress_ng(const std::string &arguments);

class Disturbance {
 public:
  /// Starts a program in a process group of its own, which dies with this process however that ends. Throws
  /// std::runtime_error: it cannot be started, or has ended already.
  explicit Disturbance(std::vector<std::string> words);
  /// Ends the whole group and waits for it: SIGTERM, and SIGKILL for what is left after three seconds.
  ~Disturbance();
  Disturbance(const Disturbance &) = delete;
  Disturbance &operator=(const Disturbance &) = delete;

  /// Throws std::runtime_error if the program has ended: what was measured since was not disturbed.
  void expect_running();

 private:
  [[nodiscard]] bool has_ended();

  std::string name_;
  pid_t child_ = 0;  // and its group; 0: has been waited for
};

}  // namespace closed_loop
