// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// What this process holds and does, as the kernel and the allocator count it. No state.
#pragma once

#include <cstdint>

namespace redag::soak {

struct ProcessFigures {
  double heap_kib = 0;      // allocated and not freed
  double resident_kib = 0;  // of all memory
  double threads = 0;
  double files = 0;            // open descriptors
  std::uint64_t wake_ups = 0;  // of all threads but the calling one, since each began
  std::int64_t cpu = 0;        // nanoseconds of processor time, all threads
};

[[nodiscard]] ProcessFigures process_figures();

}  // namespace redag::soak
