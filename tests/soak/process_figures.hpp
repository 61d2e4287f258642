// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Figures of this process from the kernel and the allocator. No state.
#pragma once

#include <cstdint>

namespace redag::soak {

struct ProcessFigures {
  double heap_kib = 0;      // allocated and not freed
  double resident_kib = 0;  // resident memory of the process
  double threads = 0;
  double files = 0;            // open descriptors
  std::uint64_t wake_ups = 0;  // of all threads but the calling one, since each started
  std::int64_t cpu = 0;        // processor time of all threads, in nanoseconds
};

[[nodiscard]] ProcessFigures process_figures();

}  // namespace redag::soak
