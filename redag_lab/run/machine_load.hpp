// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Ordinary threads that keep a machine busy: memory, system calls and wake-ups, as other programs would. Owns its
// threads; ends them in the destructor.
#pragma once

#include <atomic>
#include <cstddef>
#include <vector>

#include "redag/base/result.hpp"
#include "redag/runtime/threads.hpp"

namespace redag::runtime {

class MachineLoad {
 public:
  MachineLoad() = default;
  ~MachineLoad();
  MachineLoad(const MachineLoad &) = delete;
  MachineLoad &operator=(const MachineLoad &) = delete;

  /// Once. Error: the threads cannot be made.
  [[nodiscard]] Result<void> start(std::size_t threads);

 private:
  void main() noexcept;

  std::atomic<bool> stop_{false};
  std::vector<ThreadHandle> threads_;
};

}  // namespace redag::runtime
