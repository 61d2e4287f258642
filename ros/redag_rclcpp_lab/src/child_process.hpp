// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// A program that a benchmark starts, ends, and asks for its processor time.
#pragma once

#include <sys/types.h>

#include <string>
#include <vector>

namespace redag_rclcpp::lab {

/// The destructor kills the process if it still runs.
class ChildProcess {
 public:
  /// `command`: the program's path and its arguments. `output`: a file that gets what the process prints. Throws
  /// std::runtime_error.
  ChildProcess(const std::vector<std::string> &command, const std::string &output);
  ~ChildProcess();
  ChildProcess(const ChildProcess &) = delete;
  ChildProcess &operator=(const ChildProcess &) = delete;

  /// Ends the process by SIGINT, and returns the processor time in seconds that it used. Throws std::runtime_error if
  /// the process does not end within 30 s, or not with exit status 0.
  double end();

 private:
  pid_t id_ = -1;
};

}  // namespace redag_rclcpp::lab
