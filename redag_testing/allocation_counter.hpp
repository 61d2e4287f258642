// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Counts heap allocations of the calling thread. Linking this replaces the global operator new.
#pragma once

#include <cstdint>

namespace redag::testing {

/// Allocations by this thread so far.
[[nodiscard]] std::uint64_t allocation_count();

}  // namespace redag::testing
