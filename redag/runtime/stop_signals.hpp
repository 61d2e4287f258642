// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Lets signals stop an executor (Executor::run_until_signal). One of these at a time in a process.
#pragma once

#include <csignal>
#include <initializer_list>
#include <utility>
#include <vector>

#include "redag/runtime/executor.hpp"

namespace redag::runtime {

class StopSignals {
 public:
  /// Installs the handlers. Throws std::logic_error while there is another StopSignals, and std::invalid_argument for a
  /// signal that cannot be handled.
  StopSignals(Executor &executor, std::initializer_list<int> signals);
  /// Restores the previous handlers, and waits until no handler runs.
  ~StopSignals();
  StopSignals(const StopSignals &) = delete;
  StopSignals &operator=(const StopSignals &) = delete;

  /// The first signal that came; 0: none.
  [[nodiscard]] int received() const noexcept;

 private:
  void restore() noexcept;

  std::vector<std::pair<int, struct sigaction>> previous_;
};

}  // namespace redag::runtime
