// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Counts heap allocations of the calling thread. Linking this file replaces the global operator new.
#pragma once

#include <cstdint>

namespace redag::testing {

/// The number of allocations by this thread up to now.
[[nodiscard]] std::uint64_t allocation_count();

/// The most memory that this thread has had on the heap since the object was made, beyond what it had then. One at a
/// time counts; memory that another thread frees counts on.
class PeakMemory {
 public:
  PeakMemory();
  [[nodiscard]] std::int64_t bytes() const;

 private:
  std::int64_t before_;
};

}  // namespace redag::testing
