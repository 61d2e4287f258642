// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Ordinary threads that keep a machine busy with memory accesses, system calls and wake-ups, as other programs would.
// Owns its threads; the destructor ends them.
#pragma once

#include <atomic>
#include <cstddef>
#include <vector>

#include "redag/base/result.hpp"
#include "redag/threads/threads.hpp"

namespace redag::lab {

class MachineLoad {
 public:
  MachineLoad() = default;
  ~MachineLoad();
  MachineLoad(const MachineLoad &) = delete;
  MachineLoad &operator=(const MachineLoad &) = delete;

  /// Starts the threads. Call it once. Error: the threads cannot be created.
  [[nodiscard]] Result<void> start(std::size_t threads);

 private:
  void main() noexcept;

  std::atomic<bool> stop_{false};
  std::vector<runtime::ThreadHandle> threads_;
};

}  // namespace redag::lab
